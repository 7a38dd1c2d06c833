// Which parts of surfaces lie inside solids: walls that are lit on both sides, open models, sides of one leaf.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <glm/ext/matrix_transform.hpp>
#include <span>

#include "tests/unit/scene/built_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

Material bothSides() {
  Material material;
  material.double_sided = true;
  return material;
}

/// A vertical wall of 4 m by 1 m.
Primitive banner() {
  Primitive p;
  addQuad(p, {-2, 0, 0}, {2, 0, 0}, {2, 1, 0}, {-2, 1, 0});
  return p;
}

TEST(Burial, ARoomOfWallsSeenFromBothSidesIsNoInsideOfTheHouseAroundIt) {
  Scene scene;
  place(scene, box({0, 0, 0}, {6, 3, 6}));
  place(scene, box({0.2, 0.2, 0.2}, {5.8, 2.8, 5.8}, true), glm::dmat4(1.0), bothSides());
  place(scene, box({2, 1, 2}, {3, 2, 3}));
  const PatchScene patches = build(scene, 4'000);
  const double room = 2 * 5.6 * 5.6 + 4 * 5.6 * 2.6;
  EXPECT_NEAR(areaOf(patches, 0, 1), room, 1e-3 * room);
  EXPECT_EQ(areaOf(patches, 1, 1), 0.0) << "between the walls and the house";
  EXPECT_NEAR(areaOf(patches, 0, 2), 6.0, 6e-3) << "what stands in the room";
  // What is lost at the back takes no places from the front.
  for (const Surface& surface : patches.surfaces) {
    if (surface.instance != 1) continue;
    const auto leaves = std::span(patches.leaves).subspan(surface.first_leaf, surface.width * surface.height);
    const auto full = std::ranges::count_if(leaves, &LeafPoint::full);
    EXPECT_GT(full, static_cast<std::ptrdiff_t>((surface.width - 2) * (surface.height - 2)));
  }
}

TEST(Burial, SheetsWithinASolidHideNothing) {
  // A pane that stands in the middle of a block, and reaches out of it.
  Scene scene;
  place(scene, box({-1, 0, -1}, {1, 2, 1}));
  place(scene, banner(), glm::translate(glm::dmat4(1.0), glm::dvec3(0, 0.5, 0)), bothSides());
  const PatchScene patches = build(scene, 4'000);
  for (const std::size_t side : {0U, 1U}) EXPECT_NEAR(areaOf(patches, side, 1), 2.0, 0.05) << side;
}

TEST(Burial, WhatIsBuriedAtItsEndsIsVisibleBetween) {
  // A tape whose ends lie in deep sleeves that nothing touches, open towards its middle.
  Scene scene;
  Primitive tape;
  addQuad(tape, {-0.05, 0, 0}, {0.05, 0, 0}, {0.05, 4, 0}, {-0.05, 4, 0});
  place(scene, tape, glm::dmat4(1.0), bothSides());
  for (const double low : {-0.05, 2.85}) {
    auto sleeve = box({-0.15, low, -0.15}, {0.15, low + 1.2, 0.15});
    const auto open = sleeve.indices.begin() + (low < 0.0 ? 6 : 0);
    sleeve.indices.erase(open, open + 6);
    place(scene, sleeve);
  }
  const PatchScene patches = build(scene, 4'000);
  for (const std::size_t side : {0U, 1U}) {
    EXPECT_GT(areaOf(patches, side, 0), 0.1 * 1.7) << side;
    EXPECT_LT(areaOf(patches, side, 0), 0.1 * 3.9) << side;
  }
}

/// The outside of a box without its bottom and top.
Primitive sleeve(glm::dvec3 low, glm::dvec3 high) {
  auto p = box(low, high);
  p.indices.erase(p.indices.begin(), p.indices.begin() + 12);
  return p;
}

TEST(Burial, ALegWithoutEndsHidesTheFloorAndTheSeatThatItStandsBetween) {
  // Through its ends one sees the floor from the seat, and the seat from the floor.
  Scene scene;
  place(scene, floorQuad(4.0, -2.0, -2.0));
  place(scene, sleeve({-0.3, 0, -0.3}, {0.3, 0.8, 0.3}));
  place(scene, box({-1, 0.8, -1}, {1, 1.0, 1}));
  const PatchScene patches = build(scene, 20'000);
  EXPECT_NEAR(areaOf(patches, 0, 0), 16.0 - 0.36, 0.01) << "floor";
  EXPECT_NEAR(areaOf(patches, 0, 2), 8.0 + 8 * 0.2 - 0.36, 0.01) << "seat";
  EXPECT_NEAR(areaOf(patches, 0, 1), 4 * 0.6 * 0.8, 0.01) << "leg";
}

TEST(Burial, CavitiesOfWallsBuryNothingInTheRoom) {
  // From the room one looks past their outside at the backs within, of shells of their own, or of loose linings.
  for (const bool is_loose : {false, true}) {
    Scene scene;
    const auto wall = [&](glm::dvec3 low, glm::dvec3 high) {
      place(scene, box(low + 0.003, high - 0.003));  // which share no edges
      auto cavity = box(low + 0.05, high - 0.05, true);
      for (std::size_t i = 0; is_loose && i < cavity.positions.size(); ++i) {  // quads that share no corners
        const auto* quad = &cavity.positions[i / 4 * 4];
        const auto middle = i % 4 == 0 ? 0.5 * (quad[0] + quad[2]) : 0.5 * (quad[1] + quad[3]);
        if (i % 4 == 1) cavity.positions[i] += 0.01 * (middle - cavity.positions[i]);
      }
      place(scene, cavity);
    };
    wall({-2.2, 0, -2.2}, {-2, 2, 2.2});
    wall({2, 0, -2.2}, {2.2, 2, 2.2});
    wall({-2, 0, -2.2}, {2, 2, -2});
    wall({-2, 0, 2}, {2, 2, 2.2});
    wall({-2.2, -0.2, -2.2}, {2.2, 0, 2.2});
    wall({-2.2, 2, -2.2}, {2.2, 2.2, 2.2});
    place(scene, box({-0.5, 0, -0.5}, {0.5, 1, 0.5}));
    const PatchScene patches = build(scene, 6'000);
    EXPECT_NEAR(areaOf(patches, 0, 12), 6.0, 0.01) << is_loose;
  }
}

TEST(Burial, TwoSolidsThatBeginInOnePlaneHideNothingBeforeThem) {
  // A ray that enters both at once leaves them one after the other.
  Scene scene;
  place(scene, floorQuad(4.0, -2.0, -2.0));
  place(scene, box({-1, 1, -1}, {1, 2, 1}));
  place(scene, box({-0.7, 1, -0.7}, {0.7, 3, 0.7}));
  const PatchScene patches = build(scene, 4'000);
  EXPECT_NEAR(areaOf(patches, 0, 0), 16.0, 1e-3);
}

TEST(Burial, ABackThatLiesOnASolidTakesNothingFromTheFront) {
  Scene scene;
  place(scene, floorQuad(4.0), glm::dmat4(1.0), bothSides());
  place(scene, box({0, -1, 0}, {4, 0, 4}));
  const PatchScene patches = build(scene, 4'000);
  EXPECT_NEAR(areaOf(patches, 0, 0), 16.0, 1e-3);
  EXPECT_EQ(areaOf(patches, 1, 0), 0.0);
  EXPECT_NEAR(areaOf(patches, 0, 1), 4 * 4.0 + 16.0, 0.1) << "its top is covered";
  const Surface& floor = patches.surfaces[0];
  const auto leaves = std::span(patches.leaves).subspan(floor.first_leaf, floor.width * floor.height);
  EXPECT_EQ(std::ranges::count_if(leaves, &LeafPoint::full),
            std::ranges::count_if(leaves, [](const LeafPoint& leaf) { return leaf.triangle != kNone; }))
      << "any place on it may be looked at";
}

}  // namespace
}  // namespace radiosity::scene::test
