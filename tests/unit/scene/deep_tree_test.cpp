// Trees that are as deep as they may be.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "server/geometry/bvh.h"

namespace radiosity::scene {
namespace {

// Halved again and again along three axes: a Bvh is as deep as it may be, with dozens of triangles in its last leaf.
TEST(DeepTree, OfTrianglesThatCrowdEverCloserToOnePointHasAllOfThem) {
  std::vector<Bvh::Triangle> triangles;
  for (int i = 0; i < 124; ++i) {
    for (int axis = 0; axis < 3; ++axis) {
      glm::vec3 middle(0.0F);
      middle[axis] = std::ldexp(0.4F, -i);
      const float size = 0.1F * middle[axis];
      triangles.push_back(
          {middle + glm::vec3(-size, -size, 0), middle + glm::vec3(size, 0, size), middle + glm::vec3(0, size, -size)});
    }
  }
  const Bvh tree(triangles);
  for (std::size_t i = 0; i < 30; ++i) {
    const auto& [a, b, c] = triangles[i];
    const glm::vec3 middle = (a + b + c) / 3.0F, normal = glm::normalize(glm::cross(b - a, c - a));
    const float near = 0.1F * glm::length(b - a);
    const auto hit = tree.nearestHit(glm::dvec3(middle + near * normal), glm::dvec3(-normal), 0.0, 4.0);
    ASSERT_TRUE(hit) << i;
    EXPECT_EQ(hit->triangle, i);
    EXPECT_TRUE(hit->front);
  }
}

}  // namespace
}  // namespace radiosity::scene
