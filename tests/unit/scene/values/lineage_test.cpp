// A scene built from its former self: what an edit left alone is the same, bit by bit, in the same place.
#include "server/scene/values/lineage.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/gtc/matrix_transform.hpp>

#include "server/scene/charts/build.h"

namespace radiosity::scene {
namespace {

/// A single-sided square of side 1 at height 0, facing up, or a box around the unit cube facing out.
Primitive square() {
  Primitive primitive;
  primitive.mesh = primitive.primitive = 0;
  primitive.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}};
  primitive.indices = {0, 1, 2, 0, 2, 3};
  return primitive;
}

Instance placed(std::uint32_t node, const glm::dvec3& at, double size) {
  Instance instance;
  instance.node = node;
  instance.primitive = 0;
  instance.world = glm::scale(glm::translate(glm::dmat4(1.0), at), glm::dvec3(size));
  return instance;
}

/// A large floor and three small squares above it.
Scene squares() {
  Scene scene;
  scene.materials.resize(1);
  scene.primitives = {square()};
  scene.instances = {placed(0, {0, 0, 0}, 4.0), placed(1, {0.5, 1, 0.5}, 1.0), placed(2, {2, 1, 0.5}, 1.0),
                     placed(3, {0.5, 1, 2}, 1.0)};
  return scene;
}

ChartOptions options() {
  ChartOptions charts;
  charts.texel_budget = 600;
  return charts;
}

PatchScene successor(const Scene& before, const PatchScene& patches, const Scene& after) {
  const FormerScene former{before, patches};
  return buildPatchScene(after, options(), &former).value();
}

bool overlap(const Surface& a, const Surface& b) {
  return a.place[0].page == b.place[0].page && a.place[0].x < b.place[0].x + b.width &&
         b.place[0].x < a.place[0].x + a.width && a.place[0].y < b.place[0].y + b.height &&
         b.place[0].y < a.place[0].y + a.height;
}

void expectDisjoint(const PatchScene& patches) {
  for (std::size_t a = 0; a < patches.surfaces.size(); ++a) {
    const auto& surface = patches.surfaces[a];
    EXPECT_LE(surface.place[0].x + surface.width, patches.pages[surface.place[0].page].width);
    EXPECT_LE(surface.place[0].y + surface.height, patches.pages[surface.place[0].page].height);
    for (std::size_t b = a + 1; b < patches.surfaces.size(); ++b) EXPECT_FALSE(overlap(surface, patches.surfaces[b]));
  }
}

TEST(Lineage, WhatMovesKeepsItsPlaceOnThePageAndAllElseIsTheSame) {
  const auto before = squares();
  const auto patches = buildPatchScene(before, options()).value();
  auto after = before;
  after.instances[2] = placed(2, {2.5, 1.5, 2}, 1.0);
  const auto moved = successor(before, patches, after);
  const auto map = matchPatches(before, patches, after, moved);
  ASSERT_EQ(moved.surfaces.size(), 4U);
  for (std::uint32_t s = 0; s < 4; ++s) {
    EXPECT_EQ(map.surface_before[s], s);
    EXPECT_EQ(map.moved[s], s == 2);
    EXPECT_EQ(moved.surfaces[s].place[0].x, patches.surfaces[s].place[0].x);
    EXPECT_EQ(moved.surfaces[s].place[0].y, patches.surfaces[s].place[0].y);
  }
  ASSERT_FALSE(map.boxes.empty());
  for (const auto* scene : {&patches, &moved}) {
    const auto& surface = scene->surfaces[2];
    const auto holds = [&](const ChangedBox& box) {
      return glm::all(glm::lessThanEqual(box.low, surface.bounds_min)) &&
             glm::all(glm::greaterThanEqual(box.high, surface.bounds_max));
    };
    EXPECT_TRUE(std::ranges::any_of(map.boxes, holds)) << "where it was, and where it is";
    EXPECT_EQ(std::ranges::any_of(map.came, holds), scene == &moved) << "there it came, and nothing else";
  }
}

TEST(Lineage, WhatComesTakesWhatIsFreeAndWhatWentLeavesItsPlace) {
  const auto before = squares();
  const auto patches = buildPatchScene(before, options()).value();
  auto without = before;
  without.instances[1].visible = false;
  const auto fewer = successor(before, patches, without);
  ASSERT_EQ(fewer.surfaces.size(), 3U);
  EXPECT_EQ(fewer.pages[0].width, patches.pages[0].width);
  expectDisjoint(fewer);
  const auto gone = matchPatches(before, patches, without, fewer);
  EXPECT_FALSE(gone.boxes.empty());
  EXPECT_TRUE(gone.came.empty()) << "nothing came that hides anything";
  auto with = without;
  with.instances.push_back(placed(4, {2, 1, 2}, 1.0));
  const auto other = successor(without, fewer, with);
  ASSERT_EQ(other.surfaces.size(), 4U);
  EXPECT_EQ(other.pages.size(), 1U) << "it fits where the other was";
  EXPECT_EQ(other.pages[0].width, patches.pages[0].width);
  expectDisjoint(other);
  const auto map = matchPatches(without, fewer, with, other);
  EXPECT_EQ(map.surface_before.back(), kNone);
  EXPECT_FALSE(map.moved[0]);
  ASSERT_EQ(map.came.size(), 1U);
  EXPECT_EQ(map.came[0].low, other.surfaces.back().bounds_min);
}

TEST(Lineage, BoxesLieAroundPartsAndNotAroundWhatIsBetweenThem) {
  auto before = squares();
  auto pair = square();  // two of them, far apart, in one
  pair.mesh = 1;
  for (std::size_t i = 0; i < 4; ++i) pair.positions.push_back(pair.positions[i] + glm::dvec3(3, 0, 0));
  pair.indices.insert(pair.indices.end(), {4, 5, 6, 4, 6, 7});
  before.primitives.push_back(pair);
  auto instance = placed(4, {0, 2, 0}, 0.5);
  instance.primitive = 1;
  before.instances.push_back(instance);
  const auto patches = buildPatchScene(before, options()).value();
  auto after = before;
  after.instances.back().world = placed(4, {0, 2, 3}, 0.5).world;
  const auto map = matchPatches(before, patches, after, successor(before, patches, after));
  EXPECT_EQ(map.boxes.size(), 4U) << "both parts, there and here";
  const auto part = static_cast<float>(0.5 / patches.scale);
  for (const auto& box : map.boxes) EXPECT_NEAR(box.high.x - box.low.x, part, 1e-3F * part);
}

TEST(Lineage, VeryManyPartsHaveFewBoxesThatHoldThemAll) {
  std::vector<ChangedBox> boxes;
  for (int i = 0; i < 500; ++i) {
    const glm::vec3 low(static_cast<float>(i % 25), 0.0F, static_cast<float>(i / 25));
    boxes.push_back({low, low + 0.1F});
  }
  auto joined = boxes;
  joinBoxes(joined);
  EXPECT_LE(joined.size(), 16U);
  for (const auto& box : boxes) {
    EXPECT_TRUE(std::ranges::any_of(joined, [&](const ChangedBox& j) {
      return glm::all(glm::lessThanEqual(j.low, box.low)) && glm::all(glm::greaterThanEqual(j.high, box.high));
    }));
  }
}

TEST(Lineage, ThereAndBackGivesTheSamePlaces) {
  const auto before = squares();
  const auto patches = buildPatchScene(before, options()).value();
  auto after = before;
  after.instances[3] = placed(3, {2, 2, 2}, 1.0);
  const auto away = successor(before, patches, after);
  const auto back = successor(after, away, before);
  ASSERT_EQ(back.node_area, patches.node_area);
  for (std::size_t s = 0; s < 4; ++s) EXPECT_EQ(back.surfaces[s].place[0].x, patches.surfaces[s].place[0].x);
}

TEST(Lineage, PagesAreLaidOutAnewWhenHalfOfThemLiesIdleAndTexelsWhenTheyDoNotSuit) {
  const auto before = squares();
  auto charts = options();
  charts.texel_budget = 60'000;  // pages so large that their waste counts
  const auto patches = buildPatchScene(before, charts).value();
  auto after = before;
  after.instances[0].visible = false;
  after.instances.push_back(placed(5, {0, 0, 0}, 0.1));
  after.instances.push_back(placed(6, {3.9, 0, 3.9}, 0.1));  // the unit box stays
  const FormerScene former{before, patches};
  const auto rest = buildPatchScene(after, charts, &former).value();
  EXPECT_EQ(rest.scale, patches.scale);
  EXPECT_LT(rest.texel, patches.texel) << "the budget goes to what is left";
  EXPECT_EQ(rest.texel, buildPatchScene(after, charts).value().texel);
  expectDisjoint(rest);
  auto sized = charts;  // with texels of a given size, these stay
  sized.texel_size_m = 0.02;
  const auto all = buildPatchScene(before, sized).value();
  const FormerScene sized_former{before, all};
  const auto few = buildPatchScene(after, sized, &sized_former).value();
  EXPECT_EQ(few.texel, all.texel);
  EXPECT_LT(few.pages[0].width, all.pages[0].width);
  expectDisjoint(few);
}

TEST(Lineage, ASceneThatOutgrowsItsUnitBoxGetsAnother) {
  const auto before = squares();
  const auto patches = buildPatchScene(before, options()).value();
  auto after = before;
  after.instances[2] = placed(2, {3.9, 1, 0.5}, 1.0);
  EXPECT_EQ(successor(before, patches, after).scale, patches.scale) << "a little outside is no harm";
  after.instances[2] = placed(2, {40, 1, 0.5}, 1.0);
  EXPECT_GT(successor(before, patches, after).scale, 2.0 * patches.scale);
}

TEST(Lineage, WhatABlockCoversIsAltered) {
  auto before = squares();
  before.instances.resize(2);
  Primitive box = square();
  box.mesh = 1;
  box.positions = {{0, 0, 0}, {1, 0, 0}, {1, 0, 1}, {0, 0, 1}, {0, 1, 0}, {1, 1, 0}, {1, 1, 1}, {0, 1, 1}};
  box.indices = {0, 1, 2, 0, 2, 3, 4, 6, 5, 4, 7, 6, 0, 5, 1, 0, 4, 5,
                 1, 6, 2, 1, 5, 6, 2, 7, 3, 2, 6, 7, 3, 4, 0, 3, 7, 4};
  before.primitives.push_back(box);
  before.instances.push_back(placed(2, {1, 2, 1}, 1.0));
  before.instances.back().primitive = 1;
  const auto patches = buildPatchScene(before, options()).value();
  auto after = before;
  after.instances.back().world = glm::translate(glm::dmat4(1.0), glm::dvec3(2.5, 0, 2.5));
  const auto moved = successor(before, patches, after);
  const auto map = matchPatches(before, patches, after, moved);
  const auto& floor = moved.surfaces[0];
  EXPECT_FALSE(map.moved[0]);
  std::size_t altered = 0;
  for (std::uint32_t leaf = 0; leaf < floor.width * floor.height; ++leaf)
    altered += map.leaf_altered[floor.first_leaf + leaf] ? 1 : 0;
  const double leaves = floor.width * floor.height;
  EXPECT_NEAR(static_cast<double>(altered), leaves / 16.0, leaves / 16.0) << "a sixteenth, and its rim";
  EXPECT_GT(altered, 0U);
}

}  // namespace
}  // namespace radiosity::scene
