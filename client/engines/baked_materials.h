// What a lit scene's materials have to say so that an engine shows its lightmaps as they were solved. In place; any
// thread. What is not as glTF has it is left alone: the server wrote the file.
#pragma once

#include <cstddef>

#include "client/engines/lit_scene.h"

namespace radiosity::engines {

/// Every primitive that has a lightmap gets a material with "extras": {"lightmap": page}: its own, or a copy where
/// other primitives of it lie on other pages or on none. A primitive without a material gets a white one, as which it
/// was lit. Pages from `pages` on do not count. A "lightmap" that materials had in their extras before goes: readers of
/// ours would take it for a page.
void splitMaterialsByPage(Json& gltf, std::size_t pages);

/// Of materials with a lightmap: takes out what engines would do to its light once more, or by other rules than it was
/// solved with.
/// - The ambient occlusion is in the light already; what is diffusely transmitted is in the lightmap.
/// - The part of a coat was solved for as diffuse: KHR_materials_specular of factor 0.
/// - Clear coat, sheen, iridescence and anisotropy were not solved for, and would take from the light below.
/// - KHR_materials_unlit was lit like all others.
/// - Colours of KHR_materials_pbrSpecularGlossiness, which most engines do not read, become base colours. A texture of
///   specular colours is not read: the base colour is the diffuse one then, which is too bright by as much as is
///   mirrored.
void keepDiffuseOnly(Json& gltf);

}  // namespace radiosity::engines
