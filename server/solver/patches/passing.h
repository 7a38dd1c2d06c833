// Light that passes translucent surfaces: what arrives on one side of a leaf leaves, diffusely, on the other,
//
//   B = E + rho H + tau H of the other side.
//
// Both sides of a surface have the same grid of leaves, so that each leaf has its fellow. Pure functions of values.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/solver/patches/side.h"

namespace radiosity::solver {

/// One direction of one translucent leaf; leaf values.
struct PassingLeaf {
  std::uint32_t to = 0, from = 0;
  glm::vec3 transmittance{0.0F};  ///< tau: of the irradiance of `from`, what leaves at `to`

  [[nodiscard]] glm::vec3 of(std::span<const glm::vec3> irradiance) const { return transmittance * irradiance[from]; }
};

/// In the order of `to`; those alone that have area and let something through. `transmittance`: as of
/// scene::PatchMaterials, empty where nothing is translucent. `areas`: leafAreas(). O(leaves of translucent sides).
[[nodiscard]] std::vector<PassingLeaf> passingLeaves(const scene::SideColours& transmittance,
                                                     const std::vector<Side>& sides, std::span<const float> areas);

/// Those of a side.
[[nodiscard]] std::span<const PassingLeaf> passingTo(std::span<const PassingLeaf> all, const Side& side);

}  // namespace radiosity::solver
