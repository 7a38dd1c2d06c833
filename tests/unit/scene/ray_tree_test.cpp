#include "server/scene/ray_tree.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <random>

#include "server/scene/bvh.h"
#include "tests/unit/scene/triangle_soup.h"

namespace radiosity::scene {
namespace {

// For every number of triangles around what fits in a block, and in a node of blocks.
TEST(RayTree, FindsTheHitThatTheDoublePrecisionTreeFinds) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  for (const std::size_t count : {1U, 7U, 8U, 9U, 64U, 65U, 700U}) {
    const Bvh exact(test::triangleSoup(count, 3));
    const RayTree tree(exact);
    std::size_t met = 0, missed = 0;
    for (int ray = 0; ray < 2000; ++ray) {
      const glm::dvec3 origin(uniform(random), uniform(random), uniform(random));
      glm::dvec3 direction(uniform(random), uniform(random), uniform(random));
      if (ray % 10 == 0) direction = {0.0, 1.0, 0.0};
      const double reach = ray % 2 == 0 ? 1.0 : 0.1;
      const auto expected = exact.nearestHit(origin, direction, 0.0, reach);
      RayHit hit{};
      const bool found = tree.nearestHit(glm::vec3(origin), glm::vec3(direction), static_cast<float>(reach), hit);
      (found ? met : missed) += 1;
      if (found != expected.has_value()) {  // at an edge, or at the end of the reach
        const auto other = exact.nearestHit(origin + 1e-5 * glm::dvec3(1, -2, 3), direction, 0.0, reach);
        EXPECT_EQ(found, other.has_value()) << count;
        continue;
      }
      if (!found || hit.triangle != expected->triangle) continue;
      EXPECT_NEAR(hit.t, expected->t, 1e-4);
      EXPECT_EQ(hit.front, expected->front);
    }
    EXPECT_GT(missed, 100U) << count;
    EXPECT_GT(met, count > 60 ? 50U : 0U);
  }
}

// Edges of all triangles together are some 900 unit boxes long, and by rounding a ray may pass within 5e-7 on the other
// side of them: of rays through the box that is 4.5e-4.
TEST(RayTree, FindsAnotherTriangleOnlyAsOftenAsRoundingPassesAnEdge) {
  const Bvh exact(test::triangleSoup(3000, 8));
  const RayTree tree(exact);
  std::mt19937 random(9);
  std::uniform_real_distribution<double> uniform(-0.5, 0.5);
  int differ = 0;
  constexpr int kRays = 40'000;
  for (int ray = 0; ray < kRays; ++ray) {
    const glm::dvec3 origin(uniform(random), uniform(random), uniform(random));
    const glm::dvec3 direction(uniform(random), uniform(random), uniform(random));
    const auto expected = exact.nearestHit(origin, direction, 0.0, 10.0);
    RayHit hit{};
    const bool found = tree.nearestHit(glm::vec3(origin), glm::vec3(direction), 10.0F, hit);
    differ += found != expected.has_value() || (found && hit.triangle != expected->triangle) ? 1 : 0;
  }
  EXPECT_LE(differ, 4.5e-4 * kRays);
}

// What gets out of a closed room between two of its triangles would be lost at each of a thousand bounces.
TEST(RayTree, NoRaySlipsBetweenTheTrianglesOfAClosedBox) {
  constexpr int kCells = 13;
  std::vector<Bvh::Triangle> triangles;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-0.37F, 0.41F}) {
      for (int i = 0; i < kCells * kCells; ++i) {
        const auto corner = [&](int x, int y) {
          glm::vec3 p;
          p[axis] = side;
          p[(axis + 1) % 3] = -0.37F + 0.78F * static_cast<float>(i % kCells + x) / kCells;
          p[(axis + 2) % 3] = -0.37F + 0.78F * static_cast<float>(i / kCells + y) / kCells;
          return p;
        };
        triangles.push_back({corner(0, 0), corner(1, 0), corner(1, 1)});
        triangles.push_back({corner(0, 0), corner(1, 1), corner(0, 1)});
      }
    }
  }
  const RayTree tree{Bvh(triangles)};
  std::mt19937 random(11);
  std::uniform_real_distribution<float> uniform(-0.35F, 0.35F);
  std::uniform_int_distribution<std::size_t> pick(0, triangles.size() - 1);
  for (int ray = 0; ray < 200'000; ++ray) {
    const glm::vec3 origin(uniform(random), uniform(random), uniform(random));
    // At corners and along edges: where single precision is worst.
    const auto& t = triangles[pick(random)];
    const glm::vec3 to = ray % 2 == 0 ? t[0] : t[0] + (0.35F + uniform(random)) * (t[1] - t[0]);
    RayHit hit{};
    ASSERT_TRUE(tree.nearestHit(origin, glm::normalize(to - origin), 4.0F, hit)) << ray;
  }
}

TEST(RayTree, OfNothingAndOfWhatHasNoAreaMeetsNothing) {
  RayHit hit{};
  EXPECT_FALSE(RayTree().nearestHit({0, 0, 0}, {0, 0, 1}, 10.0F, hit));
  EXPECT_FALSE(RayTree(Bvh(std::vector<Bvh::Triangle>{})).nearestHit({0, 0, 0}, {0, 0, 1}, 10.0F, hit));
  const Bvh::Triangle point{glm::vec3(0, 0, 1), glm::vec3(0, 0, 1), glm::vec3(0, 0, 1)};
  const Bvh::Triangle needle{glm::vec3(-1, 0, 1), glm::vec3(0, 0, 1), glm::vec3(1, 0, 1)};
  EXPECT_FALSE(RayTree(Bvh({point, needle})).nearestHit({0, 0, 0}, {0, 0, 1}, 10.0F, hit));
}

}  // namespace
}  // namespace radiosity::scene
