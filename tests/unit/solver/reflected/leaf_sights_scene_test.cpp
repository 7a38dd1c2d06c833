// Rays after an edit of a scene with charts, burial and surfaces that one can see through: what is kept is what a scene
// that was never edited finds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/gtc/matrix_transform.hpp>

#include "server/scene/burial/burial_record.h"
#include "server/scene/charts/build.h"
#include "server/scene/values/lineage.h"
#include "server/solver/reflected/leaf_sights.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::solver {
namespace {

constexpr std::uint16_t kRays = 32;

/// A room whose floor has a rug in its plane, with a wall that reaches through the floor, a pane, a screen that is seen
/// from both sides, a stool that stays and, last of all, one that may move.
scene::Scene furnished(const glm::dvec3& stool) {
  scene::Scene made;
  const scene::Material plain;
  auto pane = plain, screen = plain;
  pane.alpha_mode = scene::AlphaMode::kBlend;
  pane.alpha = 0.5F;
  pane.double_sided = screen.double_sided = true;
  const auto add = [&](scene::Primitive primitive, const glm::dvec3& at, const scene::Material& material) {
    primitive.posed = true;  // whole: cut by what moves, charts would get other numbers, by which rays are drawn
    scene::test::place(made, std::move(primitive), glm::translate(glm::dmat4(1.0), at), material);
  };
  const auto upright = [](double width, double height) {
    scene::Primitive quad;
    scene::test::addQuad(quad, {0, 0, 0}, {width, 0, 0}, {width, height, 0}, {0, height, 0});
    return quad;
  };
  add(scene::test::box({-2, 0, -2}, {2, 2.5, 2}, true), {}, plain);
  add(scene::test::floorQuad(1.2), {-1.5, 0.0, -1.4}, plain);
  add(scene::test::box({1.0, -0.3, -1.0}, {1.13, 1.0, 0.9}), {}, plain);
  add(upright(1.0, 1.1), {-1.2, 0.2, 1.01}, pane);
  add(upright(0.9, 1.0), {-0.3, 0.1, -1.37}, screen);
  add(scene::test::box({-0.2, 0.0, -0.2}, {0.2, 0.5, 0.2}), {0.31, 0.0, 0.73}, plain);
  add(scene::test::box({-0.25, 0.0, -0.2}, {0.25, 0.4, 0.2}), stool, plain);
  return made;
}

std::vector<std::uint32_t> endsOf(const LeafSights& sights) {
  std::vector<std::uint32_t> ends;
  for (std::uint32_t v = 0; v < sights.leafCount(); ++v) {
    for (std::size_t half = 0; half < 2; ++half) {
      for (auto end : sights.seen(half, v)) {
        for (; end >= sights.endCount(); end = sights.steps(half)[end - sights.endCount()].next)
          ends.push_back(sights.steps(half)[end - sights.endCount()].by);
        ends.push_back(end);
      }
    }
  }
  return ends;
}

void trace(LeafSights& sights) {
  sights.ask(std::vector<std::uint16_t>(sights.leafCount(), kRays));
  ASSERT_TRUE(sights.trace(HUGE_VAL));
}

/// The scene before, and the one after with what it has of it.
class EditedRoomTest : public testing::Test {
 protected:
  EditedRoomTest() { options_.texel_size_m = 0.17; }

  void expectFreshRays(const scene::Scene& scene_before, const scene::Scene& scene_after, std::uint64_t least_kept) {
    const auto before = scene::buildPatchScene(scene_before, options_);
    ASSERT_TRUE(before) << before.error().text();
    const scene::FormerScene former_scene{scene_before, *before};
    const auto after = scene::buildPatchScene(scene_after, options_, &former_scene);
    ASSERT_TRUE(after) << after.error().text();
    const auto map = scene::matchPatches(scene_before, *before, scene_after, *after);
    const auto sides_before = makeSides(*before), sides = makeSides(*after);
    LeafSights former(*before, sides_before, 1), edited(*after, sides, 1), fresh(*after, sides, 1);
    trace(former);
    trace(fresh);
    GeometryChange change{map.boxes, map.came, {}};
    std::vector<std::uint32_t> value_before;
    for (const auto& side : sides) {
      const auto old = map.surface_before[side.surface];
      const auto old_side =
          std::ranges::find_if(sides_before, [&](const Side& of) { return of.surface == old && of.side == side.side; });
      for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
        const bool altered = map.leaf_altered[after->surfaces[side.surface].first_leaf + leaf];
        change.altered.push_back(altered);
        value_before.push_back(altered || map.moved[side.surface] ? scene::kNone : old_side->first_value + leaf);
      }
    }
    const Shadows shadows(*after, sides, change);
    edited.inherit(former, value_before, shadows, LeafSights::kMostRays);
    ASSERT_TRUE(edited.trace(HUGE_VAL));
    EXPECT_EQ(endsOf(edited), endsOf(fresh));
    EXPECT_GT(edited.kept() * 100, least_kept * fresh.traced());
    EXPECT_LT(edited.kept(), fresh.traced());
  }

  scene::ChartOptions options_;
};

TEST_F(EditedRoomTest, WhatMovesLeavesAllOtherRaysWhatTheyAre) {
  for (const glm::dvec3& to : {glm::dvec3(-0.9, 0.0, -0.8), {0.87, 0.0, -0.4}, {-0.7, 0.33, 1.0}, {0.1, 0.0, -1.3}}) {
    expectFreshRays(furnished({-0.4, 0.0, 0.2}), furnished(to), 60);
    expectFreshRays(furnished(to), furnished({-0.4, 0.0, 0.2}), 60);
  }
}

TEST_F(EditedRoomTest, WhatGoesAndWhatComesLeavesAllOtherRaysWhatTheyAre) {
  for (const glm::dvec3& at : {glm::dvec3(-0.9, 0.0, -0.8), {0.87, 0.0, -0.4}, {0.31, 0.5, 0.73}}) {
    const auto with = furnished(at);
    auto without = with;
    without.instances.back().visible = false;
    expectFreshRays(with, without, 80);
    expectFreshRays(without, with, 60);
  }
}

TEST_F(EditedRoomTest, ARugThatGoesUncoversTheFloor) {
  const auto with = furnished({-0.9, 0.0, -0.8});
  auto without = with;
  without.instances[1].world = glm::translate(glm::dmat4(1.0), glm::dvec3(-1.5, 1.0, -1.4));
  expectFreshRays(with, without, 40);
  expectFreshRays(without, with, 40);
}

}  // namespace
}  // namespace radiosity::solver
