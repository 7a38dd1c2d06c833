// Of a closed surface that crosses itself some backs can be seen: it bounds no solid.
#include "server/scene/values/closed_solids.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/vec2.hpp>
#include <numbers>

#include "server/geometry/self_crossing.h"
#include "server/scene/burial/solid_finder.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::test {
namespace {

using scene::Corners;
using scene::keepsClearOfItself;

scene::PatchScene sceneOf(const std::vector<Corners>& triangles) {
  scene::PatchScene scene;
  scene.surfaces.resize(1);
  for (const auto& corners : triangles) {
    for (const auto& position : corners) {
      scene.indices.push_back(static_cast<std::uint32_t>(scene.vertices.size()));
      scene.vertices.push_back({position, 0, glm::vec2(0.0F), glm::vec3(0.0F)});
    }
    scene.triangle_surface.push_back(0);
  }
  return scene;
}

/// `profile` counter-clockwise, in x and y; it goes from z = 0 to z = 0.1. Its ends are fans around its first corner.
std::vector<Corners> prism(const std::vector<glm::vec2>& profile) {
  std::vector<Corners> triangles;
  const auto below = [&](std::size_t i) { return glm::vec3(profile[i % profile.size()], 0.0F); };
  const auto above = [&](std::size_t i) { return glm::vec3(profile[i % profile.size()], 0.1F); };
  for (std::size_t i = 0; i < profile.size(); ++i) {
    triangles.push_back({below(i), below(i + 1), above(i + 1)});
    triangles.push_back({below(i), above(i + 1), above(i)});
    if (i == 0 || i + 1 == profile.size()) continue;
    triangles.push_back({below(0), below(i + 1), below(i)});
    triangles.push_back({above(0), above(i), above(i + 1)});
  }
  return triangles;
}

std::vector<Corners> sphere(std::size_t rows) {
  const auto at = [&](std::size_t row, std::size_t column) {
    const double down = std::numbers::pi * static_cast<double>(row) / static_cast<double>(rows);
    const double around = std::numbers::pi * static_cast<double>(column % (2 * rows)) / static_cast<double>(rows);
    const double ring = row % rows == 0 ? 0.0 : 0.4 * std::sin(down);
    return glm::vec3(ring * std::cos(around), ring * std::sin(around), 0.4 * std::cos(down));
  };
  std::vector<Corners> triangles;
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t column = 0; column < 2 * rows; ++column) {
      if (row > 0) triangles.push_back({at(row, column), at(row + 1, column), at(row, column + 1)});
      if (row + 1 < rows) triangles.push_back({at(row, column + 1), at(row + 1, column), at(row + 1, column + 1)});
    }
  }
  return triangles;
}

std::size_t solidsOf(const std::vector<Corners>& triangles) {
  return scene::findClosedSolids(sceneOf(triangles)).bounds.size();
}

/// Its larger half is turned outwards, so that it encloses a positive volume; of the other the backs are outside.
std::vector<Corners> bowTie() { return prism({{-0.2F, -0.2F}, {0.1F, 0.1F}, {0.1F, -0.1F}, {-0.2F, 0.2F}}); }

TEST(ClosedSolids, ABowTieIsNoneThoughEveryEdgeIsShared) {
  EXPECT_EQ(solidsOf(bowTie()), 0U);
  EXPECT_EQ(solidsOf(prism({{-0.2F, -0.2F}, {0.1F, -0.1F}, {0.1F, 0.1F}, {-0.2F, 0.2F}})), 1U) << "not crossed";
}

TEST(ClosedSolids, OthersInTheSceneStay) {
  auto triangles = bowTie();
  const auto crossing = triangles.size();
  const auto other = prism({{0.2F, -0.1F}, {0.3F, -0.1F}, {0.3F, 0.1F}});
  triangles.insert(triangles.end(), other.begin(), other.end());
  const auto solids = scene::findClosedSolids(sceneOf(triangles));
  ASSERT_EQ(solids.bounds.size(), 1U);
  EXPECT_EQ(solids.bounds[0].low, glm::vec3(0.2F, -0.1F, 0.0F));
  for (std::size_t i = 0; i < triangles.size(); ++i)
    EXPECT_EQ(solids.solid_of[i], i < crossing ? scene::kNone : 0U) << "triangle " << i;
}

/// Without its ends; `turned`: facing in.
std::vector<Corners> sleeve(float x, bool turned) {
  auto triangles = prism({{x, -0.1F}, {x + 0.1F, -0.1F}, {x + 0.1F, 0.1F}, {x, 0.1F}});
  std::erase_if(triangles, [](const Corners& t) { return t[0].z == t[1].z && t[1].z == t[2].z; });
  for (auto& triangle : triangles) {
    if (turned) std::swap(triangle[1], triangle[2]);
  }
  return triangles;
}

TEST(ClosedSolids, WhatIsOpenAtItsEndsIsHollowAndARoomOrAPanelIsNot) {
  auto triangles = sleeve(-0.4F, false);
  const auto in_sleeve = triangles.size();
  for (const auto& others : {sleeve(-0.2F, true),
                             {{{{0, 0, 0}, {0.1F, 0.1F, 0}, {0, 0.1F, 0.1F}}}},
                             prism({{0.2F, -0.1F}, {0.3F, -0.1F}, {0.3F, 0.1F}})})
    triangles.insert(triangles.end(), others.begin(), others.end());
  const auto solids = scene::findClosedSolids(sceneOf(triangles));
  EXPECT_EQ(solids.bounds.size(), 1U);
  ASSERT_EQ(solids.hollows.size(), 1U);
  EXPECT_EQ(solids.hollows[0].low, glm::vec3(-0.4F, -0.1F, 0.0F));
  EXPECT_EQ(solids.hollows[0].high, glm::vec3(-0.3F, 0.1F, 0.1F));
  for (std::size_t i = 0; i < triangles.size(); ++i)
    EXPECT_EQ(solids.hollow_of[i], i < in_sleeve ? 0U : scene::kNone) << "triangle " << i;
}

TEST(SelfCrossing, HollowAndFlatPartsAndFineOnesAreNone) {
  EXPECT_TRUE(keepsClearOfItself(prism({{0, 0}, {0.3F, 0}, {0.3F, 0.1F}, {0.1F, 0.1F}, {0.1F, 0.3F}, {0, 0.3F}})));
  EXPECT_TRUE(keepsClearOfItself(sphere(60)));
  EXPECT_EQ(solidsOf(sphere(60)), 1U);
}

bool keepClear(const Corners& a, const Corners& b) { return keepsClearOfItself(std::array{a, b}); }

TEST(SelfCrossing, OfTrianglesWithOneCornerInCommonIsFound) {
  const glm::vec3 corner(0.0F);
  const Corners flat{corner, {0.2F, -0.1F, 0.0F}, {0.2F, 0.1F, 0.0F}};
  EXPECT_FALSE(keepClear(flat, {corner, {0.1F, 0.0F, -0.1F}, {0.1F, 0.0F, 0.1F}}));
  EXPECT_FALSE(keepClear(flat, {corner, {0.3F, -0.05F, 0.0F}, {0.1F, 0.2F, 0.0F}})) << "in one plane";
  EXPECT_TRUE(keepClear(flat, {corner, {-0.1F, 0.0F, -0.1F}, {-0.1F, 0.0F, 0.1F}}));
  EXPECT_TRUE(keepClear(flat, {corner, {0.1F, 0.2F, 0.0F}, {-0.1F, 0.2F, 0.0F}})) << "in one plane";
}

TEST(SelfCrossing, WhatTouchesOrLiesOnItselfIsTakenForCrossing) {
  const Corners flat{{{0.0F, -0.1F, 0.0F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.1F, 0.0F}}};
  EXPECT_FALSE(keepClear(flat, {{{0.05F, 0, 0}, {0.05F, 0, 0.1F}, {0.06F, 0, 0.1F}}})) << "on a tip";
  EXPECT_FALSE(keepClear(flat, {{{0.01F, 0, 0}, {0.05F, 0, 0}, {0.05F, 0.02F, 0}}})) << "in its plane";
  EXPECT_FALSE(keepClear(flat, {flat[1], flat[0], {0.05F, 0.05F, 0}})) << "folded over an edge";
  EXPECT_TRUE(keepClear(flat, {flat[1], flat[0], {0.05F, -0.2F, 0}})) << "beside an edge";
}

TEST(SelfCrossing, OfManyThatAllMeetInOnePlaceIsNotLookedFor) {
  const auto disc = [](int corners) {
    std::vector<glm::vec2> profile;
    for (int i = 0; i < corners; ++i) {
      const double angle = 2.0 * std::numbers::pi * i / corners;
      profile.emplace_back(0.4 * std::cos(angle), 0.4 * std::sin(angle));
    }
    return prism(profile);
  };
  EXPECT_TRUE(keepsClearOfItself(disc(200)));
  EXPECT_FALSE(keepsClearOfItself(disc(2000)));
}

}  // namespace
}  // namespace radiosity::test
