// Places on leaves within which light changes: partly covered or buried ones, and full ones in narrow gaps.
#include <gtest/gtest.h>

#include <algorithm>

#include <glm/geometric.hpp>

#include "server/scene/patch_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene {
namespace {

using namespace test;

PatchScene build(const Scene& scene, double texel_size) {
  ChartOptions options;
  options.texel_size_m = texel_size;
  auto patches = buildPatchScene(scene, options);
  EXPECT_TRUE(patches.has_value());
  return patches ? std::move(*patches) : PatchScene{};
}

glm::dvec3 worldOf(const PatchScene& patches, const LeafSpot& spot) {
  const auto& frame = patches.triangles[spot.triangle];
  return glm::dvec3(frame.origin + spot.texel.x * frame.du + spot.texel.y * frame.dv) * patches.scale + patches.centre;
}

TEST(LeafSpots, LieEvenlyOverWhatABlockLeavesOfALeaf) {
  Scene scene;
  place(scene, floorQuad(10.0, -5.0, -5.0));
  place(scene, box({-1.15, 0.0, -1.0}, {1.0, 2.0, 1.0}));
  const PatchScene patches = build(scene, 0.25);
  std::size_t seen = 0;
  for (std::size_t i = 0; i < 1600; ++i) {
    const auto& leaf = patches.leaves[patches.surfaces[0].first_leaf + i];
    if (leaf.triangle == kNone || leaf.full) continue;
    ASSERT_NE(leaf.first_spot, kNone) << i;
    ++seen;
    glm::dvec3 mean(0.0);
    for (std::uint32_t k = 0; k < kLeafSpots; ++k) {
      const auto at = worldOf(patches, patches.spot(leaf, k));
      EXPECT_FALSE(at.x > -1.15 && at.x < 1.0 && std::abs(at.z) < 1.0) << at.x << " " << at.z;
      mean += at / double{kLeafSpots};
    }
    // The block's left face cuts a column of leaves from x = -1.25 to -1.0: 0.1 of 0.25 is left.
    EXPECT_NEAR(mean.x, -1.2, 0.01);
    const double row = std::floor(mean.z / 0.25) * 0.25;
    EXPECT_NEAR(mean.z, row + 0.125, 0.04) << "they are places of a lattice of 64, of which 26 are left";
  }
  EXPECT_EQ(seen, 8U);
}

TEST(LeafSpots, EveryEighthRowHasSomeInEveryQuarter) {
  Scene scene;
  place(scene, floorQuad(4.0));
  place(scene, floorQuad(2.0, 1.0, 1.0), glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0.01, 0, 1));
  const PatchScene patches = build(scene, 0.5);
  for (const auto& leaf : patches.leaves) {
    if (leaf.first_spot == kNone) continue;
    const glm::vec2 low = glm::floor(leaf.texel);
    for (std::uint32_t first = 0; first < 8; ++first) {
      std::uint32_t quarters = 0;
      for (std::uint32_t k = 0; k < 2 * kSpotQuarters; ++k) {
        const std::uint32_t row = first + 8 * (k / kSpotQuarters);
        const glm::vec2 in = patches.spot(leaf, row * kSpotQuarters + k % kSpotQuarters).texel - low;
        quarters |= 1U << (2U * (in.y > 0.5F ? 1U : 0U) + (in.x > 0.5F ? 1U : 0U));
      }
      EXPECT_EQ(quarters, 15U);
    }
  }
}

TEST(LeafSpots, FullLeavesHaveThemOnlyInNarrowGapsAndBesideThem) {
  Scene scene;
  place(scene, box({0, 0, 0}, {4, 3, 4}, true));
  Material sheet;  // seen from both sides it bounds no solid
  sheet.double_sided = true;
  place(scene, floorQuad(1.0, 1.5, 1.5), glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 2.95, 0, 1), sheet);
  const PatchScene patches = build(scene, 0.25);
  std::size_t above = 0, by_its_rim = 0;
  for (const auto& surface : patches.surfaces) {
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const auto& leaf = patches.leaves[surface.first_leaf + i];
      if (!leaf.full || leaf.first_spot == kNone) continue;
      const auto at = worldOf(patches, {leaf.texel, leaf.triangle});
      EXPECT_GT(at.y, 2.9) << "walls that meet are no gap";
      const double beside = std::max({1.5 - at.x, at.x - 2.5, 1.5 - at.z, at.z - 2.5});
      // Two leaves from the sheet, the leaf's middle half a one farther, but for rounding: the next is a whole one
      // away.
      EXPECT_LT(beside, 0.5 + 0.125 + 1e-3);
      ++(beside < 0.0 ? above : by_its_rim);
    }
  }
  EXPECT_GE(above, 32U) << "of ceiling and sheet";
  EXPECT_GE(by_its_rim, 48U) << "of the ceiling, around sixteen";
}

}  // namespace
}  // namespace radiosity::scene
