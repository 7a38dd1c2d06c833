#include "server/geometry/bvh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <random>

#include "server/scene/values/scene.h"
#include "tests/unit/scene/triangle_soup.h"

namespace radiosity::scene {
namespace {

TEST(Bvh, FindsTheHitsThatASearchOfAllTrianglesFinds) {
  const auto triangles = test::triangleSoup(500, 3);
  const Bvh tree(triangles);
  std::vector<Bvh> single;
  for (const auto& t : triangles) single.emplace_back(std::vector<Bvh::Triangle>{t});
  std::mt19937 random(4);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  std::size_t total = 0;
  for (int ray = 0; ray < 300; ++ray) {
    const glm::dvec3 origin(uniform(random), uniform(random), uniform(random));
    glm::dvec3 direction(uniform(random), uniform(random), uniform(random));
    if (ray % 10 == 0) direction = {0.0, 1.0, 0.0};
    std::vector<RayHit> hits;
    tree.collectHits(origin, direction, 0.0, 1.0, hits);
    std::vector<std::uint32_t> found, expected;
    for (const auto& hit : hits) found.push_back(hit.triangle);
    for (std::uint32_t t = 0; t < triangles.size(); ++t) {
      std::vector<RayHit> alone;
      single[t].collectHits(origin, direction, 0.0, 1.0, alone);
      if (!alone.empty()) expected.push_back(t);
    }
    std::ranges::sort(found);
    EXPECT_EQ(found, expected);
    total += found.size();
  }
  EXPECT_GT(total, 100U);
}

TEST(Bvh, TheNearestHitIsTheFirstOfAll) {
  const Bvh tree(test::triangleSoup(500, 3));
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  std::size_t met = 0, missed = 0;
  for (int ray = 0; ray < 1000; ++ray) {
    const glm::dvec3 origin(uniform(random), uniform(random), uniform(random));
    const glm::dvec3 direction(uniform(random), uniform(random), uniform(random));
    const double reach = ray % 2 == 0 ? 1.0 : 0.1;
    std::vector<RayHit> hits;
    tree.collectHits(origin, direction, 0.0, reach, hits);
    const auto nearest = tree.nearestHit(origin, direction, 0.0, reach);
    ASSERT_EQ(nearest.has_value(), !hits.empty());
    ASSERT_EQ(tree.meets(origin, direction, 0.0, reach), !hits.empty());
    (nearest ? met : missed) += 1;
    if (!nearest) continue;
    const auto first = std::ranges::min_element(hits, {}, &RayHit::t);
    EXPECT_EQ(nearest->t, first->t);
    EXPECT_EQ(nearest->triangle, first->triangle);
    EXPECT_EQ(nearest->front, first->front);
  }
  EXPECT_GT(met, 100U);
  EXPECT_GT(missed, 100U);
}

TEST(Bvh, KnowsFrontFromBack) {
  const Bvh tree({{glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)}});
  std::vector<RayHit> hits;
  tree.collectHits({0.2, 0.2, 1.0}, {0, 0, -1}, 0.0, 2.0, hits);
  tree.collectHits({0.2, 0.2, -1.0}, {0, 0, 1}, 0.0, 2.0, hits);
  ASSERT_EQ(hits.size(), 2U);
  EXPECT_TRUE(hits[0].front);
  EXPECT_FALSE(hits[1].front);
  EXPECT_DOUBLE_EQ(hits[0].t, 1.0);
}

TEST(Bvh, WhereNoBackMayBeMetNoRayMeetsOne) {
  std::mt19937 random(11);
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  const auto point = [&] { return glm::vec3(number(random), number(random), number(random)); };
  std::vector<Bvh::Triangle> triangles;
  for (int i = 0; i < 60; ++i) {
    const auto at = point();
    triangles.push_back({at, at + 0.2F * point(), at + 0.2F * point()});
  }
  const Bvh tree(triangles);
  int open = 0, met = 0;
  for (int i = 0; i < 400; ++i) {
    const auto low = point(), high = low + 0.1F * glm::abs(point());
    const glm::dvec3 direction(point());
    const bool may = tree.mayMeetBack(low, high, direction, 8.0);
    open += may ? 0 : 1;
    for (int k = 0; k < 50; ++k) {
      const auto origin = glm::mix(low, high, 0.5F * (point() + 1.0F));
      std::vector<RayHit> hits;
      tree.collectHits(glm::dvec3(origin), direction, 0.0, 8.0, hits);
      const bool back = std::ranges::any_of(hits, [](const RayHit& hit) { return !hit.front; });
      met += back ? 1 : 0;
      EXPECT_TRUE(may || !back) << i;
    }
  }
  EXPECT_GT(open, 50);
  EXPECT_GT(met, 100);
}

TEST(Bvh, TouchesIgnoresTheTagAndMissesBoxesBesideADiagonal) {
  const Bvh tree({{glm::vec3(0, 0, 0), glm::vec3(1, 1, 0), glm::vec3(1, 1, 1)}});
  const std::vector<std::uint32_t> tags{7};
  EXPECT_TRUE(tree.touches(glm::vec3(0.4F), glm::vec3(0.6F), tags, kNone));
  EXPECT_FALSE(tree.touches(glm::vec3(0.4F), glm::vec3(0.6F), tags, 7));
  EXPECT_FALSE(tree.touches({0.7F, 0.1F, 0.0F}, {0.9F, 0.3F, 0.5F}, tags, kNone));
}

TEST(Bvh, AfterSoManyLooksSomethingMayTouchABox) {
  // All have bounds that hold the box, and none comes near it.
  std::vector<Bvh::Triangle> triangles(1000, {glm::vec3(0, 0, 0), glm::vec3(1, 1, 0), glm::vec3(1, 1, 1)});
  const std::vector<std::uint32_t> tags(triangles.size(), 7);
  const Bvh tree(std::move(triangles));
  const glm::vec3 low(0.7F, 0.1F, 0.0F), high(0.9F, 0.3F, 0.5F);
  EXPECT_FALSE(tree.touches(low, high, tags, kNone));
  EXPECT_FALSE(tree.touches(low, high, tags, kNone, 10'000));
  EXPECT_TRUE(tree.touches(low, high, tags, kNone, 100));
  const Bvh::OrientedBox box{
      0.5F * (low + high), {glm::vec3(1, 0, 0), glm::vec3(0, 1, 0), glm::vec3(0, 0, 1)}, 0.5F * (high - low)};
  EXPECT_FALSE(tree.touches(box, tags, kNone, 10'000));
  EXPECT_TRUE(tree.touches(box, tags, kNone, 100));
  EXPECT_FALSE(tree.hoversIn(box, tags, kNone, 10'000));
  EXPECT_TRUE(tree.hoversIn(box, tags, kNone, 100));
}

TEST(Bvh, ManyEqualTrianglesDoNotOverflow) {
  std::vector<Bvh::Triangle> triangles(5000, {glm::vec3(0, 0, 0), glm::vec3(1, 0, 0), glm::vec3(0, 1, 0)});
  const Bvh tree(std::move(triangles));
  std::vector<RayHit> hits;
  tree.collectHits({0.2, 0.2, 1.0}, {0, 0, -1}, 0.0, 2.0, hits);
  EXPECT_EQ(hits.size(), 5000U);
}

}  // namespace
}  // namespace radiosity::scene
