// What the reference's rays meet, against all triangles one by one.
#include "tests/oracle/ray_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace radiosity::oracle {
namespace {

class RaySceneTest : public testing::Test {
 protected:
  double number() { return uniform_(random_); }
  glm::dvec3 point() { return {number(), number(), number()}; }
  void add(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
    Triangle triangle;
    triangle.corners = {a, b, c};
    triangle.normal = glm::normalize(glm::cross(b - a, c - a));
    triangles_.push_back(triangle);
  }
  void addQuad(const glm::dvec3& a, const glm::dvec3& u, const glm::dvec3& v) {
    add(a, a + u, a + u + v);
    add(a, a + u + v, a + v);
  }
  /// Distance along the way to the plane of a triangle, where the ray meets it; negative: it does not.
  [[nodiscard]] static double meets(const std::array<glm::dvec3, 3>& c, const glm::dvec3& from, const glm::dvec3& way) {
    const auto normal = glm::cross(c[1] - c[0], c[2] - c[0]);
    const double t = glm::dot(normal, c[0] - from) / glm::dot(normal, way);
    const auto at = from + t * way;
    for (std::size_t k = 0; k < 3; ++k)
      if (glm::dot(glm::cross(c[(k + 1) % 3] - c[k], at - c[k]), normal) < 0.0) return -1.0;
    return t;
  }

  std::mt19937_64 random_{3};
  std::uniform_real_distribution<double> uniform_{-1.0, 1.0};
  std::vector<Triangle> triangles_;
};

TEST_F(RaySceneTest, MeetsFirstWhatIsNearestOfAll) {
  for (int i = 0; i < 300; ++i) {
    const auto a = point();
    add(a, a + 0.2 * point(), a + 0.2 * point());
  }
  for (int i = 0; i < 60; ++i) {  // flat in one of the axes, as walls are
    glm::dvec3 u(0.0), v(0.0);
    u[i % 3] = 0.5 * number();
    v[(i + 1) % 3] = 0.5 * number();
    addQuad(point(), u, v);
  }
  const RayScene scene(triangles_);
  for (int i = 0; i < 20'000; ++i) {
    const auto from = 2.0 * point(), way = point();
    double nearest = HUGE_VAL;
    for (const auto& triangle : triangles_) {
      std::array<glm::dvec3, 3> corners{};
      for (std::size_t k = 0; k < 3; ++k) corners[k] = scene.toUnit(triangle.corners[k]);
      const double t = meets(corners, from, way);
      if (t > 0.0) nearest = std::min(nearest, t);
    }
    const auto met = scene.first(from, way, HUGE_VAL, [](const RayScene::Met&) { return true; });
    ASSERT_EQ(met.has_value(), nearest < HUGE_VAL) << i;
    if (met) {
      ASSERT_NEAR(met->distance, nearest, 1e-9 * nearest) << i;
    }
    ASSERT_EQ(scene.blocked(from, way), nearest <= 1.0) << i;
  }
}

TEST_F(RaySceneTest, NothingLeavesAClosedRoom) {
  for (int axis = 0; axis < 3; ++axis) {
    for (const double at : {-1.0, 1.0}) {
      glm::dvec3 corner(-1.0), u(0.0), v(0.0);
      corner[axis] = at;
      u[(axis + 1) % 3] = 2.0;
      v[(axis + 2) % 3] = 2.0;
      addQuad(corner, u, v);
    }
  }
  const RayScene scene(triangles_);
  for (int i = 0; i < 1'000'000; ++i) {
    const auto met = scene.first(0.99 * point(), point(), HUGE_VAL, [](const RayScene::Met&) { return true; });
    ASSERT_TRUE(met) << i;
    ASSERT_GE(std::min({met->u, met->v, 1.0 - met->u - met->v}), -1e-11);
  }
}

}  // namespace
}  // namespace radiosity::oracle
