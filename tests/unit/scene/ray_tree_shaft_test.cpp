// RayTree::hide(), against single rays in double precision.
#include <gtest/gtest.h>

#include <array>
#include <glm/geometric.hpp>
#include <random>
#include <vector>

#include "server/scene/bvh.h"
#include "server/scene/ray_tree.h"
#include "tests/unit/scene/triangle_soup.h"

namespace radiosity::scene {
namespace {

constexpr float kSpare = 2e-6F;
constexpr std::size_t kPoints = 64;

class RayTreeShaftTest : public testing::Test {
 protected:
  double uniform(double low, double high) { return std::uniform_real_distribution<double>(low, high)(random_); }
  glm::dvec3 inBox() { return {uniform(-0.5, 0.5), uniform(-0.5, 0.5), uniform(-0.5, 0.5)}; }

  /// A place, and before it a polygon of three or four corners that faces it.
  void makeView(std::size_t corner_count) {
    const glm::dvec3 middle = inBox();
    from_ = glm::vec3(inBox());
    const glm::dvec3 way = glm::normalize(glm::dvec3(from_) - middle);
    const glm::dvec3 along = glm::normalize(glm::cross(way, inBox())), across = glm::cross(way, along);
    const glm::dvec3 u = uniform(0.02, 0.3) * along, v = uniform(0.02, 0.3) * across;
    corners_ = {glm::vec3(middle - u - v), glm::vec3(middle + u - v), glm::vec3(middle + u + v)};
    if (corner_count == 4) corners_.push_back(glm::vec3(middle - u + v));
    of_end_ = glm::vec3(way);
    normal_ = glm::vec3(glm::normalize(-way + 0.5 * along));
    points_ = {};
    for (std::size_t i = 0; i < kPoints; ++i) {
      double s = uniform(0.0, 1.0), t = uniform(0.0, 1.0);
      if (corner_count == 3 && t > s) std::swap(s, t);  // in the half that there is
      const glm::vec3 point(middle + (2.0 * s - 1.0) * u + (2.0 * t - 1.0) * v);
      points_.x.push_back(point.x);
      points_.y.push_back(point.y);
      points_.z.push_back(point.z);
    }
  }
  [[nodiscard]] glm::dvec3 point(std::size_t i) const { return {points_.x[i], points_.y[i], points_.z[i]}; }
  /// Of a ray that leaves the place upwards of its plane.
  [[nodiscard]] bool isHidden(const Bvh& tree, std::size_t i, const glm::dvec3& beside = glm::dvec3(0.0)) const {
    const glm::dvec3 way = point(i) - glm::dvec3(from_) - beside;
    return tree.meets(glm::dvec3(from_) + beside, way, 0.0, 1.0 - static_cast<double>(kSpare) / glm::length(way));
  }

  std::mt19937 random_{11};
  glm::vec3 from_{0.0F}, normal_{0.0F}, of_end_{0.0F};
  std::vector<glm::vec3> corners_;
  ShaftPoints points_;
};

TEST_F(RayTreeShaftTest, HidesThePointsThatRaysDoNotReach) {
  std::size_t hidden_in_all = 0, seen_in_all = 0, differ = 0;
  for (const std::size_t count : {1U, 8U, 9U, 65U, 400U}) {
    const Bvh exact(test::triangleSoup(count, 3));
    const RayTree tree(exact);
    for (int view = 0; view < 300; ++view) {
      makeView(view % 2 == 0 ? 4 : 3);
      std::array<std::int32_t, kPoints> hidden{};
      hidden.fill(7);  // what there was before does not count
      ASSERT_TRUE(tree.hide({from_, normal_, corners_, of_end_, kSpare}, points_, 1000, hidden.data()));
      for (std::size_t i = 0; i < kPoints; ++i) {
        // What lies below the place's own plane would be no hindrance, and no point does.
        if (glm::dot(point(i) - glm::dvec3(from_), glm::dvec3(normal_)) < 1e-3) continue;
        const bool is_hidden = isHidden(exact, i);
        (is_hidden ? hidden_in_all : seen_in_all) += 1;
        ASSERT_TRUE(hidden[i] == 0 || hidden[i] == 1);
        if ((hidden[i] != 0) == is_hidden) continue;
        ++differ;  // at an edge: a ray beside it is told otherwise
        const bool may_differ = isHidden(exact, i, {2e-6, -2e-6, 2e-6}) != isHidden(exact, i, {-2e-6, 2e-6, -2e-6}) ||
                                isHidden(exact, i, {2e-6, 2e-6, 2e-6}) != isHidden(exact, i, {-2e-6, -2e-6, -2e-6}) ||
                                isHidden(exact, i, {2e-6, 0.0, 0.0}) != is_hidden ||
                                isHidden(exact, i, {-2e-6, 0.0, 0.0}) != is_hidden;
        EXPECT_TRUE(may_differ) << count << " triangles, view " << view << ", point " << i;
      }
    }
  }
  EXPECT_GT(hidden_in_all, 10'000U);
  EXPECT_GT(seen_in_all, 10'000U);
  EXPECT_LT(differ, 20U) << "of 96,000";
}

// The floor that a place lies on, and what its lamp hangs under, hide nothing; a sheet right before either does.
TEST_F(RayTreeShaftTest, HidesNothingByWhatPlaceAndEndLieOn) {
  const auto sheet = [](float y, std::vector<Bvh::Triangle>& into) {
    const glm::vec3 a(-0.4F, y, -0.4F), b(0.4F, y, -0.4F), c(0.4F, y, 0.4F), d(-0.4F, y, 0.4F);
    into.push_back({a, b, c});
    into.push_back({a, c, d});
  };
  std::vector<Bvh::Triangle> both;
  sheet(-0.3F, both);
  sheet(0.3F, both);
  const std::vector<glm::vec3> corners{
      {-0.1F, 0.3F, -0.1F}, {0.1F, 0.3F, -0.1F}, {0.1F, 0.3F, 0.1F}, {-0.1F, 0.3F, 0.1F}};
  ShaftPoints points{{0.05F, -0.05F, 0.09F, 0.0F, 0.01F, 0.02F, 0.03F, 0.04F},
                     std::vector<float>(8, 0.3F),
                     {0.05F, -0.09F, 0.0F, 0.0F, 0.01F, 0.02F, 0.03F, 0.04F}};
  const Shaft shaft({0.1F, -0.3F + 2e-6F, 0.2F}, {0.0F, 1.0F, 0.0F}, corners, {0.0F, -1.0F, 0.0F}, 1e-6F);
  std::array<std::int32_t, 8> hidden{};
  ASSERT_TRUE(RayTree(Bvh(both)).hide(shaft, points, 10, hidden.data()));
  EXPECT_EQ(hidden, (std::array<std::int32_t, 8>{}));
  for (const float y : {-0.29F, 0.29F, 0.0F}) {
    auto three = both;
    sheet(y, three);
    ASSERT_TRUE(RayTree(Bvh(three)).hide(shaft, points, 10, hidden.data()));
    EXPECT_EQ(hidden, (std::array<std::int32_t, 8>{1, 1, 1, 1, 1, 1, 1, 1})) << y;
    // Where more may hide them than shall be looked through, it says so.
    EXPECT_FALSE(RayTree(Bvh(three)).hide(shaft, points, 0, hidden.data()));
  }
}

TEST_F(RayTreeShaftTest, WithoutTrianglesNothingIsHidden) {
  makeView(4);
  std::array<std::int32_t, kPoints> hidden{};
  hidden.fill(1);
  ASSERT_TRUE(RayTree().hide({from_, normal_, corners_, of_end_, kSpare}, points_, 10, hidden.data()));
  EXPECT_EQ(hidden, (std::array<std::int32_t, kPoints>{}));
}

}  // namespace
}  // namespace radiosity::scene
