// What a lit scene's glTF has to say so that an engine shows its lightmaps, and nothing twice. Changes values in place;
// any thread. What is not as glTF has it is left alone: the server wrote the file.
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "client/engines/lit_scene.h"

namespace radiosity::engines {

/// Every primitive that has a lightmap gets a material with "extras": {"lightmap": page}: its own, or a copy where
/// other primitives of it lie on other pages or on none. A primitive without a material gets a white one, as which it
/// was lit. Pages from `pages` on do not count.
void splitMaterialsByPage(Json& gltf, std::size_t pages);

/// Of materials with a lightmap: takes out what engines would do to its light once more, or by other rules than it was
/// solved with. The ambient occlusion is in the light already; a coat's part of the light was solved for as diffuse
/// (KHR_materials_specular of factor 0); what is diffusely transmitted is in the lightmap; colours of
/// KHR_materials_pbrSpecularGlossiness, which most engines do not read, become base colours.
void keepDiffuseOnly(Json& gltf);

/// Takes lamps out, which are in the lightmaps, and skies that engines would light with. A lamp's node keeps what it
/// was as "extras": {"bakedLight": {...}}. Returns the names of the nodes.
std::vector<std::string> takeLightsOut(Json& gltf);

/// Nodes that KHR_node_visibility hides, with all below them, lose their meshes: not every engine reads the extension.
void takeHiddenOut(Json& gltf);

}  // namespace radiosity::engines
