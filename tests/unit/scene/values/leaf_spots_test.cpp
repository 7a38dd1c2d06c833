// Places on leaves within which light changes: partly covered or buried ones, and full ones in narrow gaps.
#include <gtest/gtest.h>

#include <algorithm>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <vector>

#include "server/scene/charts/build.h"
#include "server/scene/values/patch_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene {
namespace {

using test::box;
using test::floorQuad;
using test::place;

PatchScene buildWithTexels(const Scene& scene, double texel_size) {
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
  const PatchScene patches = buildWithTexels(scene, 0.25);
  std::size_t seen = 0;
  for (std::size_t i = 0; i < 1600; ++i) {
    const auto& leaf = patches.leaves[patches.surfaces[0].first_leaf + i];
    if (leaf.triangle == kNone || leaf.full) continue;
    ASSERT_TRUE(leaf.hasSpots()) << i;
    ++seen;
    glm::dvec3 mean(0.0);
    const auto count = patches.spotCount(leaf);
    EXPECT_NEAR(count, 0.4 * kLeafLattice, 1.0) << "the block's left face leaves 0.1 of 0.25";
    for (std::uint32_t k = 0; k < count; ++k) {
      const auto at = worldOf(patches, patches.spot(leaf, k));
      EXPECT_FALSE(at.x > -1.15 && at.x < 1.0 && std::abs(at.z) < 1.0) << at.x << " " << at.z;
      mean += at / static_cast<double>(count);
    }
    EXPECT_NEAR(mean.x, -1.2, 0.001);
    const double row = std::floor(mean.z / 0.25) * 0.25;
    EXPECT_NEAR(mean.z, row + 0.125, 0.002) << "a lattice of 256, of which 102 are left";
  }
  EXPECT_EQ(seen, 8U);
}

// A chart of two facets: a place of one in the frame of the other would lie behind it, and everything hides its light.
TEST(LeafSpots, LieOnTheirOwnTrianglesWhereAChartIsBentALittle) {
  constexpr double kBend = 2e-4;
  Primitive sheet;
  sheet.positions = {{-2, 0, 0}, {0, 0, 0}, {2, 2 * kBend, 0}, {-2, 0, 2.03}, {0, 0, 2.03}, {2, 2 * kBend, 2.03}};
  sheet.indices = {0, 3, 1, 1, 3, 4, 1, 4, 2, 2, 4, 5};
  Scene scene;
  place(scene, sheet);
  const PatchScene patches = buildWithTexels(scene, 0.3);
  std::size_t bent = 0;
  for (const auto& leaf : patches.leaves) {
    if (!leaf.hasSpots() || leaf.full) continue;
    bool left = false, right = false;
    for (std::uint32_t k = 0; k < patches.spotCount(leaf); ++k) {
      const auto at = worldOf(patches, patches.spot(leaf, k));
      EXPECT_NEAR(at.y, std::max(0.0, at.x) * kBend, 1e-6) << "rounding of 32 bits";
      (at.x < 0.0 ? left : right) = true;
    }
    bent += left && right ? 1 : 0;
  }
  EXPECT_GE(bent, 1U);
}

std::vector<LeafSpot> spotsOf(const PatchScene& patches, const LeafPoint& leaf) {
  std::vector<LeafSpot> spots;
  for (std::uint32_t k = 0; leaf.hasSpots() && k < patches.spotCount(leaf); ++k) spots.push_back(patches.spot(leaf, k));
  return spots;
}

/// Which no wall cuts.
Primitive wholeFloor() {
  Primitive floor = floorQuad(10.0, -5.0, -5.0);
  floor.posed = true;
  return floor;
}

// A wall 0.03 of a leaf thick: of the places right along it no two are near each other. And what a block leaves of
// leaves at a rim, 0.0075 of 0.25.
TEST(LeafSpots, WhatIsHiddenOrLeftMayBeNarrowerThanPlacesAreApart) {
  for (const auto& [low, high] : {std::pair(0.1, 0.1075), std::pair(0.0075, 0.24)}) {
    Scene scene;
    place(scene, wholeFloor());
    place(scene, box({low, 0.0, -2.0}, {high, 2.0, 2.0}));
    const PatchScene patches = buildWithTexels(scene, 0.25);
    double area = 0.0, leaves = 0.0;
    for (std::size_t i = 0; i < 1600; ++i) {
      const auto& leaf = patches.leaves[patches.surfaces[0].first_leaf + i];
      if (leaf.triangle == kNone || leaf.full || !leaf.hasSpots()) continue;
      leaves += 1.0;
      area +=
          static_cast<double>(patches.node_area[patches.surfaces[0].first_node[0] + i]) * patches.scale * patches.scale;
      for (const auto& spot : spotsOf(patches, leaf)) {
        const auto at = worldOf(patches, spot);
        EXPECT_FALSE(at.x > low + 1e-6 && at.x < high - 1e-6 && std::abs(at.z) < 2.0) << at.x << " " << at.z;
      }
    }
    EXPECT_EQ(leaves, 16.0);
    EXPECT_NEAR(area / leaves / 0.0625, 1.0 - (high - low) / 0.25, 1.0 / kLeafLattice) << "one place more or less";
  }
}

// A sheet of light's edge may lie anywhere: the part of the spots on one side of a line is that of what is left.
TEST(LeafSpots, AThinStripBehindAPostIsAPartLikeAnyOther) {
  Scene scene;
  place(scene, wholeFloor());
  place(scene, box({0.023, 0.0, -2.0}, {0.12, 2.0, 2.0}));  // of leaves 0.25 wide: 0.023 before it, 0.13 behind
  const PatchScene patches = buildWithTexels(scene, 0.25);
  std::size_t seen = 0;
  for (std::size_t i = 0; i < 1600; ++i) {
    const auto& leaf = patches.leaves[patches.surfaces[0].first_leaf + i];
    if (leaf.triangle == kNone || leaf.full || !leaf.hasSpots()) continue;
    ++seen;
    const auto count = patches.spotCount(leaf);
    double before = 0.0;
    for (std::uint32_t k = 0; k < count; ++k) before += worldOf(patches, patches.spot(leaf, k)).x < 0.05 ? 1 : 0;
    EXPECT_NEAR(before / count, 0.023 / 0.153, 1.0 / count) << "one place more or less";
  }
  EXPECT_EQ(seen, 16U);
}

TEST(LeafSpots, EveryEighthRowHasSomeInEveryQuarter) {
  for (const float at : {0.0F, 0.4F, 0.999F}) {
    for (std::uint32_t first = 0; first < 8; ++first) {
      std::uint32_t quarters = 0;
      for (std::uint32_t k = 0; k < 2 * kSpotQuarters; ++k) {
        const std::uint32_t row = first + 8 * (k / kSpotQuarters);
        const glm::vec2 in = kSpotsOfFull[LeafSpots::indexOf(kLeafLattice, row, k % kSpotQuarters, at)];
        quarters |= 1U << (2U * (in.y > 0.5F ? 1U : 0U) + (in.x > 0.5F ? 1U : 0U));
      }
      EXPECT_EQ(quarters, 15U);
    }
  }
}

// One evenly spread number draws row and spot.
TEST(LeafSpots, ADrawReachesAllOfThem) {
  std::vector<int> times(102, 0);
  for (int i = 0; i < 4096; ++i) {
    const auto draw = SpotDraw::from((i + 0.5) / 4096);
    for (std::uint32_t quarter = 0; quarter < kSpotQuarters; ++quarter)
      ++times.at(LeafSpots::indexOf(102, draw.row, quarter, draw.at));
  }
  for (const int one : times) EXPECT_NEAR(one, 4096.0 * kSpotQuarters / 102, 1.0);
}

// Also where their number is no multiple of the rows': or a part of the leaf would count twice.
TEST(LeafSpots, AllAreLookedAtEquallyOften) {
  constexpr std::uint32_t kSteps = 1000;
  for (const std::uint32_t count : {2U, 47U, 64U, 183U, 256U}) {
    std::vector<double> times(count, 0.0);
    for (std::uint32_t row = 0; row < kSpotRows; ++row)
      for (std::uint32_t quarter = 0; quarter < kSpotQuarters; ++quarter)
        for (std::uint32_t step = 0; step < kSteps; ++step)
          times.at(LeafSpots::indexOf(count, row, quarter, (static_cast<float>(step) + 0.5F) / kSteps)) += 1.0;
    const double mean = 1.0 * kSpotRows * kSpotQuarters * kSteps / count;
    for (const double one : times) EXPECT_NEAR(one / mean, 1.0, 0.01) << count << ": steps of a thousandth";
  }
}

TEST(LeafSpots, AnyPartOfAListIsAPartOfTheLeaf) {
  LeafSpots spots;
  std::vector<LeafSpots::Place> places;
  for (std::uint16_t i = 0; i < 256; ++i)
    if (latticePoint(i, 256).x < 0.6875) places.push_back({i, 7});
  LeafSpots::order(256, places);
  const auto list = spots.add({{10.0F, 20.0F}, glm::vec2(1.0F), 256}, places, true);
  ASSERT_EQ(spots.countOf(list), places.size());
  const auto eighth = spots.countOf(list) / 8;
  for (std::uint32_t part = 0; part < 8; ++part) {
    glm::vec2 low(1e9F), high(-1e9F);
    for (auto k = part * eighth; k < (part + 1) * eighth; ++k) {
      const auto spot = spots.at(list, k, 3);
      EXPECT_EQ(spot.triangle, 3U) << "in one frame: the leaf's own";
      low = glm::min(low, spot.texel);
      high = glm::max(high, spot.texel);
    }
    const auto size = high - low;
    EXPECT_LT(size.x * size.y, 0.6875 / 8.0);
  }
}

TEST(LeafSpots, FullLeavesHaveThemOnlyInNarrowGapsAndBesideThem) {
  Scene scene;
  place(scene, box({0, 0, 0}, {4, 3, 4}, true));
  Material sheet;  // seen from both sides it bounds no solid
  sheet.double_sided = true;
  place(scene, floorQuad(1.0, 1.5, 1.5), glm::dmat4(1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 2.95, 0, 1), sheet);
  const PatchScene patches = buildWithTexels(scene, 0.25);
  std::size_t above = 0, by_its_rim = 0;
  for (const auto& surface : patches.surfaces) {
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const auto& leaf = patches.leaves[surface.first_leaf + i];
      if (!leaf.full || !leaf.hasSpots()) continue;
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
