// Rays where leaves stand in for each other, and where surfaces coincide.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/solver/reflected/leaf_sights.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::kDark;
using test::kGrey;
using test::makeQuadScene;
using test::Quad;

/// Where a ray goes on from, and where it ends.
std::vector<std::uint32_t> chain(const LeafSights& sights, std::size_t half, std::uint32_t end) {
  std::vector<std::uint32_t> leaves;
  for (; end >= sights.endCount(); end = sights.steps(half)[end - sights.endCount()].next)
    leaves.push_back(sights.steps(half)[end - sights.endCount()].by);
  leaves.push_back(end);
  return leaves;
}

/// Of all rays.
std::vector<std::uint32_t> all(const LeafSights& sights) {
  std::vector<std::uint32_t> ends;
  for (std::uint32_t v = 0; v < sights.leafCount(); ++v) {
    for (std::size_t half = 0; half < 2; ++half) {
      for (const auto end : sights.seen(half, v)) {
        const auto leaves = chain(sights, half, end);
        ends.insert(ends.end(), leaves.begin(), leaves.end());
      }
    }
  }
  return ends;
}

void trace(LeafSights& sights, std::uint16_t count) {
  sights.ask(std::vector<std::uint16_t>(sights.leafCount(), count));
  ASSERT_TRUE(sights.trace(HUGE_VAL));
}

/// What was covered by what is gone, so that a neighbour was lit in its place, is seen itself.
TEST(LeafSightsEdit, ALeafThatHasAreaAgainIsSeenInsteadOfWhoStoodInForIt) {
  constexpr std::uint32_t kLeaf = 6;
  const auto before = makeQuadScene(cubeQuads(4, kDark, kGrey)), after = makeQuadScene(cubeQuads(4, kDark, kGrey));
  before.patches->node_area[kLeaf] = 0.0F;
  const auto sides = makeSides(*after.patches);
  LeafSights former(*before.patches, sides, 1), edited(*after.patches, sides, 1), fresh(*after.patches, sides, 1);
  trace(former, 256);
  trace(fresh, 256);
  GeometryChange change;
  change.boxes = {{glm::vec3(-0.001F, -0.5F, -0.001F), glm::vec3(0.001F, -0.49F, 0.001F)}};
  change.altered.assign(fresh.leafCount(), false);
  change.altered[kLeaf] = true;
  const Shadows shadows(*after.patches, sides, change);
  std::vector<std::uint32_t> value_before(fresh.leafCount());
  std::iota(value_before.begin(), value_before.end(), 0U);
  value_before[kLeaf] = scene::kNone;
  edited.inherit(former, value_before, shadows, LeafSights::kMostRays);
  EXPECT_GT(edited.kept(), former.traced() / 2);
  ASSERT_TRUE(edited.trace(HUGE_VAL));
  EXPECT_EQ(all(edited), all(fresh));
}

/// Walls of no thickness are modelled as two that coincide, back to back.
TEST(LeafSightsEdit, OfWallsBackToBackAreTheirFronts) {
  auto quads = cubeQuads(4, kDark, kGrey);
  const glm::vec3 corner(-0.37F, -0.41F, 0.03F), across(0.71F, 0.05F, 0.02F), up(0.03F, 0.83F, -0.11F);
  quads.push_back({corner, across, up, 8, 8});
  quads.push_back({corner, up, across, 8, 8});
  const auto made = makeQuadScene(quads);
  const auto sides = makeSides(*made.patches);
  LeafSights sights(*made.patches, sides, 1);
  trace(sights, 256);
  const auto ends = all(sights);
  // But for rays along the wall, of which rounding makes more.
  EXPECT_LT(std::ranges::count_if(ends, [&](auto end) { return sights.isAbsorbed(end); }), 10) << "of " << ends.size();
}

/// Rays that two surfaces in one plane share see the same of both, however the tree lies.
TEST(LeafSightsEdit, OfCoincidentSurfacesStayWhatTheyWere) {
  auto quads = cubeQuads(4, kDark, kGrey);
  const glm::vec3 corner(-0.37F, -0.41F, 0.03F), across(0.71F, 0.05F, 0.02F), up(0.03F, 0.83F, -0.11F);
  for (int i = 0; i < 3; ++i) quads.push_back({corner, across, up, 8, 8});
  const auto before = makeQuadScene(quads);
  for (int i = 0; i < 40; ++i)
    quads.push_back({{-0.45F + 0.02F * static_cast<float>(i), -0.45F, -0.45F}, {0, 0, 0.01F}, {0.01F, 0, 0}, 1, 1});
  const auto after = makeQuadScene(quads);
  const auto sides_before = makeSides(*before.patches), sides_after = makeSides(*after.patches);
  LeafSights former(*before.patches, sides_before, 1), edited(*after.patches, sides_after, 1),
      fresh(*after.patches, sides_after, 1);
  trace(former, 64);
  trace(fresh, 64);
  GeometryChange change;
  change.altered.assign(fresh.leafCount(), false);
  std::vector<std::uint32_t> value_before(fresh.leafCount(), scene::kNone);
  std::iota(value_before.begin(), value_before.begin() + former.leafCount(), 0U);
  for (std::size_t i = 9; i < quads.size(); ++i) {
    change.came.push_back({quads[i].origin, quads[i].origin + quads[i].du + quads[i].dv});
    change.altered[former.leafCount() + i - 9] = true;
  }
  change.boxes = change.came;
  const Shadows shadows(*after.patches, sides_after, change);
  edited.inherit(former, value_before, shadows, LeafSights::kMostRays);
  ASSERT_TRUE(edited.trace(HUGE_VAL));
  EXPECT_EQ(all(edited), all(fresh));
}

/// A wall that moves along the floor: leaves that lay in it in part are whole, and others are not.
TEST(LeafSightsEdit, LeavesPartlyInsideAreThoseOfTheSceneAsItIs) {
  const auto room = [](float middle) {
    auto quads = cubeQuads(5, kDark, kGrey);
    const glm::vec3 low(middle, -0.5F, -0.5F), y(0, 1, 0), z(0, 0, 1), half(0.05F, 0, 0);
    quads.push_back({low + half, y, z, 5, 5});
    quads.push_back({low - half, z, y, 5, 5});
    return makeQuadScene(quads);
  };
  const auto before = room(0.0F), after = room(0.2F);
  const auto sides = makeSides(*before.patches), sides_after = makeSides(*after.patches);
  LeafSights former(*before.patches, sides, 1), edited(*after.patches, sides_after, 1),
      fresh(*after.patches, sides_after, 1);
  trace(former, 16);
  trace(fresh, 16);
  GeometryChange change;
  change.boxes = {{glm::vec3(-0.06F, -0.5F, -0.5F), glm::vec3(0.26F, 0.5F, 0.5F)}};
  change.came = {{glm::vec3(0.14F, -0.5F, -0.5F), glm::vec3(0.26F, 0.5F, 0.5F)}};
  change.altered.assign(fresh.leafCount(), false);
  std::vector<std::uint32_t> value_before(fresh.leafCount());
  std::iota(value_before.begin(), value_before.end(), 0U);
  for (auto v = sides[6].first_value; v < fresh.leafCount(); ++v) value_before[v] = scene::kNone;
  const Shadows shadows(*after.patches, sides_after, change);
  edited.inherit(former, value_before, shadows, LeafSights::kMostRays);
  ASSERT_TRUE(edited.trace(HUGE_VAL));
  EXPECT_GT(edited.kept(), 100U);
  std::size_t parted = 0;
  for (std::uint32_t v = 0; v < fresh.leafCount(); ++v) {
    EXPECT_EQ(edited.isParted(v), fresh.isParted(v)) << v;
    parted += fresh.isParted(v) ? 1 : 0;
  }
  EXPECT_EQ(all(edited), all(fresh));
  EXPECT_GE(parted, 15U) << "a column of the floor, of the ceiling, and of two walls";
  EXPECT_LE(parted, 40U);
}

}  // namespace
}  // namespace radiosity::solver
