// What patches emit and reflect. Pure functions of values; any thread.
#pragma once

#include <cstdint>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// Leaves are integrated over textures and vertex colours (16 samples a leaf), parents are area-weighted means.
/// Reflectance is clamped to 0.999; with transmittance, the sum of both.
[[nodiscard]] PatchMaterials shadePatches(const Scene& scene, const PatchScene& patches);

/// Recomputes the nodes of the surfaces that use `material`; returns those surfaces.
std::vector<std::uint32_t> reshadeMaterial(const Scene& scene, const PatchScene& patches, std::uint32_t material,
                                           PatchMaterials& materials);

}  // namespace radiosity::scene
