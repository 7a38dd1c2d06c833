// Rays that look for the end of a solid, and for the earliest of what lies in one place: they find what a look at all
// hits finds, for less.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <random>
#include <tuple>

#include "server/geometry/solid_tree.h"
#include "tests/unit/scene/triangle_soup.h"

namespace radiosity::scene {
namespace {

std::vector<RayHit> sortedHits(const Bvh& tree, const glm::dvec3& origin, const glm::dvec3& direction, double reach) {
  std::vector<RayHit> hits;
  tree.collectHits(origin, direction, 0.0, reach, hits);
  std::ranges::sort(hits, {}, [](const RayHit& hit) { return std::tuple(hit.t, hit.front, hit.triangle); });
  return hits;
}

std::optional<double> endOf(const std::vector<RayHit>& hits) {
  int depth = 0;
  for (const auto& hit : hits) {
    depth += hit.front ? 1 : -1;
    if (depth < 0) return hit.t;
  }
  return std::nullopt;
}

TEST(BvhWalk, FindsTheEndOfASolidThatAllHitsTell) {
  const Bvh tree(test::triangleSoup(2000, 3));
  const SolidTree solids(tree);
  std::mt19937 random(6);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  std::size_t inside = 0, outside = 0;
  for (int ray = 0; ray < 2000; ++ray) {
    const glm::dvec3 origin(uniform(random), uniform(random), uniform(random));
    glm::dvec3 direction(uniform(random), uniform(random), uniform(random));
    if (ray % 10 == 0) direction = {0.0, 1.0, 0.0};
    const auto all = sortedHits(tree, origin, direction, 2.0);
    std::vector<RayHit> hits;
    std::uint64_t work = 0;
    const auto end = SolidTree::endOfSolid(std::array{&solids}, origin, direction, 2.0, hits, work);
    ASSERT_EQ(end, endOf(all));
    (end ? inside : outside) += 1;
    if (end) continue;
    ASSERT_EQ(hits.size(), all.size());
    for (std::size_t i = 0; i < all.size(); ++i) EXPECT_EQ(hits[i].triangle, all[i].triangle);
  }
  EXPECT_GT(inside, 200U);
  EXPECT_GT(outside, 200U);
}

TEST(BvhWalk, WhatLiesBehindTheEndOfASolidCostsNothing) {
  std::vector<Bvh::Triangle> sheets;  // their backs towards the rays
  for (int i = 0; i < 4000; ++i) {
    const float z = static_cast<float>(i) / 4000.0F;
    sheets.push_back({glm::vec3(-1, -1, z), glm::vec3(1, -1, z), glm::vec3(0, 1, z)});
  }
  const Bvh tree(sheets);
  const SolidTree solids(tree);
  std::vector<RayHit> hits;
  std::uint64_t work = 0;
  for (int i = 0; i < 100; ++i) {
    const double z = i / 100.0 + 0.0001;
    EXPECT_TRUE(SolidTree::endOfSolid(std::array{&solids}, {0.01, -0.1, z}, {0.01, 0.02, 1.0}, 8.0, hits, work));
  }
  EXPECT_LT(work / 100, 100U) << "of 4000";
}

/// Walls that lie through each other in many trees: hits come in no order at all.
TEST(BvhWalk, HitsThatComeInNoOrderAreSorted) {
  std::vector<Bvh::Triangle> walls;
  std::mt19937 random(9);
  std::uniform_real_distribution<float> uniform(0.0F, 1.0F);
  for (int i = 0; i < 20'000; ++i) {
    const glm::vec3 at(uniform(random), uniform(random), uniform(random));
    walls.push_back({at, at + glm::vec3(0, 0.4F, 0), at + glm::vec3(0.4F, 0, 0.4F)});
    if (i % 2 == 0) std::swap(walls.back()[1], walls.back()[2]);
  }
  const std::array<Bvh, 2> trees{Bvh(walls), Bvh({walls.begin(), walls.begin() + 5000})};
  const std::array<SolidTree, 2> solids{SolidTree(trees[0]), SolidTree(trees[1])};
  const std::array<const SolidTree*, 2> both{&solids[0], &solids[1]};
  std::size_t most = 0;
  for (int ray = 0; ray < 200; ++ray) {
    const glm::dvec3 direction(1.0, uniform(random) - 0.5, uniform(random) - 0.5);
    std::vector<RayHit> hits, of_second;
    std::uint64_t work = 0;
    const auto end = SolidTree::endOfSolid(both, {-0.1, 0.5, 0.5}, direction, 2.0, hits, work);
    auto all = sortedHits(trees[0], {-0.1, 0.5, 0.5}, direction, 2.0);
    for (auto hit : sortedHits(trees[1], {-0.1, 0.5, 0.5}, direction, 2.0)) {
      hit.tree = 1;
      all.push_back(hit);
    }
    std::ranges::sort(all, {}, [](const RayHit& hit) { return std::tuple(hit.t, hit.front, hit.tree, hit.triangle); });
    ASSERT_EQ(end, endOf(all));
    most = std::max(most, hits.size());
    if (end) continue;
    ASSERT_EQ(hits.size(), all.size());
    for (std::size_t i = 0; i < all.size(); ++i)
      EXPECT_EQ(std::pair(hits[i].tree, hits[i].triangle), std::pair(all[i].tree, all[i].triangle));
  }
  EXPECT_GT(most, 100U);
}

TEST(BvhWalk, NobodyLooksFartherThanItMayTake) {
  const Bvh tree(test::triangleSoup(20'000, 3));
  const SolidTree solids(tree);
  std::vector<RayHit> hits;
  std::uint64_t work = 0;
  EXPECT_FALSE(SolidTree::endOfSolid(std::array{&solids}, {-0.6, 0.0, 0.0}, {1.0, 0.01, 0.02}, 8.0, hits, work, 100));
  EXPECT_GE(work, 100U);
  EXPECT_LT(work, 200U);
}

TEST(BvhWalk, WhatRisesAboveAPlaneIsTold) {
  const auto triangles = test::triangleSoup(40, 5);
  const Bvh tree(triangles);
  std::mt19937 random(8);
  std::uniform_real_distribution<float> uniform(-1.0F, 1.0F);
  std::size_t above = 0;
  for (int i = 0; i < 2000; ++i) {
    const glm::vec3 normal(uniform(random), uniform(random), uniform(random));
    float highest = -1e9F;
    for (const auto& triangle : triangles)
      for (const auto& corner : triangle) highest = std::max(highest, glm::dot(normal, corner));
    const float height = highest * (1.0F + 0.1F * uniform(random));
    EXPECT_EQ(tree.risesAbove(normal, height), highest > height);
    above += highest > height ? 1 : 0;
  }
  EXPECT_GT(above, 500U);
  EXPECT_LT(above, 1500U);
}

TEST(BvhWalk, TheLeastTagIsThatOfAllHits) {
  const auto triangles = test::triangleSoup(500, 3);
  const Bvh tree(triangles);
  std::vector<std::uint32_t> tags(triangles.size());
  for (std::size_t i = 0; i < tags.size(); ++i) tags[i] = static_cast<std::uint32_t>(i * 37 % 100);  // several of each
  const auto least = tree.leastTags(tags);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  std::size_t met = 0;
  for (int ray = 0; ray < 1000; ++ray) {
    const glm::dvec3 origin(uniform(random), uniform(random), uniform(random));
    const glm::dvec3 direction(uniform(random), uniform(random), uniform(random));
    const std::uint32_t end = ray % 2 == 0 ? 100 : 50;
    std::vector<RayHit> hits;
    tree.collectHits(origin, direction, 0.0, 1.0, hits);
    std::optional<std::uint32_t> expected;
    for (const auto& hit : hits) {
      if (!hit.front || tags[hit.triangle] >= (expected ? tags[*expected] : end)) continue;
      expected = hit.triangle;
    }
    const auto found = tree.leastHit(origin, direction, 0.0, 1.0, tags, least, end, &RayHit::front);
    ASSERT_EQ(found.has_value(), expected.has_value());
    if (!found) continue;
    EXPECT_EQ(found->triangle, *expected);
    ++met;
  }
  EXPECT_GT(met, 100U);
}

// Thousands of faces on each other: one is looked at, not all.
TEST(BvhWalk, OfWhatCoincidesTheFirstIsFoundAtOnce) {
  const std::vector<Bvh::Triangle> sheets(5000, {glm::vec3(-1, -1, 0), glm::vec3(1, -1, 0), glm::vec3(0, 1, 0)});
  const Bvh tree(sheets);
  std::vector<std::uint32_t> tags(sheets.size());
  for (std::size_t i = 0; i < tags.size(); ++i) tags[i] = static_cast<std::uint32_t>(i);
  std::size_t asked = 0;
  const auto found = tree.leastHit({0, 0, 1e-6}, {0, 0, -1}, 0.0, 2e-6, tags, tree.leastTags(tags), 4000,
                                   [&](const RayHit&) { return ++asked > 0; });
  ASSERT_TRUE(found);
  EXPECT_EQ(found->triangle, 0U);
  EXPECT_LT(asked, 10U);
}

}  // namespace
}  // namespace radiosity::scene
