#include "server/solver/patches/flat_nodes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

namespace radiosity::test {
namespace {

using scene::kNone;
using solver::FlatNodes;

constexpr std::uint32_t kSide = 8;

/// A surface of two squares of full leaves that is not planar; which triangle each lies in.
scene::PatchScene sheet(std::vector<scene::TriangleFrame> triangles,
                        const std::function<std::uint32_t(std::uint32_t x, std::uint32_t y)>& triangle) {
  scene::PatchScene patches;
  patches.triangles = std::move(triangles);
  scene::Surface surface;
  surface.width = 2 * kSide;
  surface.height = kSide;
  surface.level_count = scene::levelCount(2 * kSide, kSide);
  surface.planar = false;
  patches.surfaces.push_back(surface);
  for (std::uint32_t y = 0; y < kSide; ++y) {
    for (std::uint32_t x = 0; x < 2 * kSide; ++x) {
      scene::LeafPoint leaf;
      leaf.triangle = triangle(x, y);
      leaf.full = leaf.triangle != kNone;
      patches.leaves.push_back(leaf);
    }
  }
  return patches;
}

/// Texels of 0.01 on the floor; to the right of x = 8 bent up by this slope.
scene::TriangleFrame bent(float slope) {
  const float across = 0.01F / std::sqrt(1.0F + slope * slope);
  const glm::vec3 du(across, slope * across, 0.0F), dv(0.0F, 0.0F, -0.01F);
  return {glm::vec3(0.08F, 0.0F, 0.0F) - 8.0F * du, du, dv, glm::normalize(glm::cross(du, dv))};
}

constexpr std::uint32_t kTop = 4;  // the level of one node

TEST(FlatNodes, PartsOfAFoldedSheetAreFlatAndTheWholeIsNot) {
  const auto patches =
      sheet({bent(0.0F), bent(1.0F)}, [](std::uint32_t x, std::uint32_t /*y*/) { return x < 8 ? 0U : 1U; });
  const FlatNodes flat(patches);
  EXPECT_EQ(flat.triangle(0, 3, 0, 0), 0U);
  EXPECT_EQ(flat.triangle(0, 3, 1, 0), 1U);
  EXPECT_EQ(flat.triangle(0, 0, 8, 7), 1U);
  EXPECT_EQ(flat.triangle(0, kTop, 0, 0), kNone);
  EXPECT_TRUE(flat.isFolded(0, kTop, 0, 0));
  EXPECT_FALSE(flat.isFolded(0, 3, 0, 0));
}

TEST(FlatNodes, TrianglesInOneFrameAreOne) {
  const auto patches =
      sheet({bent(0.0F), bent(0.0F)}, [](std::uint32_t x, std::uint32_t y) { return x < 2 * y ? 0U : 1U; });
  const FlatNodes flat(patches);
  EXPECT_NE(flat.triangle(0, kTop, 0, 0), kNone);
  EXPECT_FALSE(flat.isFolded(0, kTop, 0, 0));
}

// A hemicube that stood in the plane of one of them would stand behind the other.
TEST(FlatNodes, NearlyOnePlaneIsNotOne) {
  const auto patches =
      sheet({bent(0.0F), bent(1e-3F)}, [](std::uint32_t x, std::uint32_t /*y*/) { return x < 8 ? 0U : 1U; });
  EXPECT_EQ(FlatNodes(patches).triangle(0, kTop, 0, 0), kNone);
}

TEST(FlatNodes, EmptyLeavesDoNotMatterAndAnEmptyNodeIsNotFlat) {
  const auto patches = sheet({bent(0.0F)}, [](std::uint32_t x, std::uint32_t /*y*/) { return x < 8 ? 0U : kNone; });
  const FlatNodes flat(patches);
  EXPECT_EQ(flat.triangle(0, kTop, 0, 0), 0U);
  EXPECT_EQ(flat.triangle(0, 3, 1, 0), kNone);
  EXPECT_FALSE(flat.isFolded(0, 3, 1, 0));
}

/// Every column of leaves has its own slope: no node is worth being split for the flat ones in it.
TEST(FlatNodes, ACurvedSheetIsNotFolded) {
  std::vector<scene::TriangleFrame> triangles;
  for (int x = 0; x < 16; ++x) triangles.push_back(bent(0.1F * static_cast<float>(x)));
  const auto patches = sheet(std::move(triangles), [](std::uint32_t x, std::uint32_t /*y*/) { return x; });
  const FlatNodes flat(patches);
  for (std::uint32_t level = 0; level <= kTop; ++level) {
    EXPECT_EQ(flat.triangle(0, level, 0, 0), kNone);
    EXPECT_FALSE(flat.isFolded(0, level, 0, 0));
  }
}

TEST(FlatNodes, OneOddSpotOfALeafIsAFold) {
  auto patches = sheet({bent(0.0F), bent(1.0F)}, [](std::uint32_t /*x*/, std::uint32_t /*y*/) { return 0U; });
  auto& leaf = patches.leaves[5];
  leaf.full = false;
  leaf.texel = {5.5F, 0.5F};
  std::vector<scene::LeafSpots::Place> places{{0, 0}, {1, 0}};
  leaf.spot_list = patches.spots.add({{5.0F, 0.0F}, glm::vec2(1.0F), 64}, places, false);
  EXPECT_EQ(FlatNodes(patches).triangle(0, 0, 5, 0), 0U);
  places.back().triangle = 1;
  patches.leaves[5].spot_list = patches.spots.add({{5.0F, 0.0F}, glm::vec2(1.0F), 64}, places, false);
  const FlatNodes flat(patches);
  EXPECT_EQ(flat.triangle(0, 0, 5, 0), kNone);
  EXPECT_EQ(flat.triangle(0, 3, 0, 0), kNone);
  EXPECT_EQ(flat.triangle(0, 3, 1, 0), 0U);
}

}  // namespace
}  // namespace radiosity::test
