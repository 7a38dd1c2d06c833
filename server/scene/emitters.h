// Which surfaces emit light, as far as it decides what is seen of faces that lie on each other (PatchScene::seenOrder).
#pragma once

#include "server/scene/patch_scene.h"
#include "server/scene/scene.h"

namespace radiosity::scene {

/// Whether a material emits anywhere, as far as its factors tell.
[[nodiscard]] inline bool mayEmit(const Material& material) { return material.emission != glm::vec3(0.0F); }

/// Fills Surface::emits: the material has emission, and its texture is not black all over the surface. Needs triangles
/// and their sources. Cost: of surfaces with an emissive texture the pixels they show, until one is not black.
void findEmitters(const Scene& scene, PatchScene& patches);

}  // namespace radiosity::scene
