// What lightmaps hold of translucent surfaces, so that whoever multiplies them by the base colour shows what glows
// through. Pure functions of values; any thread.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// Below this a base colour counts as this, since no lightmap makes black shine: what glows more is lost to lightmaps.
inline constexpr float kLeastBase = 0.01F;

/// Irradiance, or anything linear in it, by node of level 0, becomes what a surface of the base colour alone would need
/// to look the same: (rho H + tau H of the other side) / base; H itself where base is black. Of squares (of errors) the
/// factors are squared. No-op where nothing is translucent. O(leaves of translucent surfaces).
enum class SidesOf { kLight, kSquares };
void joinTranslucentSides(const PatchScene& patches, const PatchMaterials& materials, std::vector<glm::vec3>& nodes,
                          SidesOf what = SidesOf::kLight);

}  // namespace radiosity::scene
