#include "server/solver/change_reach.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <random>

namespace radiosity::solver {
namespace {

/// Part of cosine-weighted directions whose rays meet the box.
double byRays(const glm::vec3& origin, const glm::vec3& normal, const scene::ChangedBox& box, std::mt19937& random) {
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  int hits = 0;
  constexpr int kRays = 40'000;
  for (int i = 0; i < kRays; ++i) {
    glm::vec3 p;
    do p = {number(random), number(random), number(random)};
    while (glm::dot(p, p) > 1.0F || glm::dot(p, p) < 1e-4F);
    const glm::vec3 way = normal + glm::normalize(p);
    float first = 0.0F, last = 1e30F;
    for (int axis = 0; axis < 3; ++axis) {
      const float a = (box.low[axis] - origin[axis]) / way[axis], b = (box.high[axis] - origin[axis]) / way[axis];
      first = std::max(first, std::min(a, b));
      last = std::min(last, std::max(a, b));
    }
    hits += first <= last ? 1 : 0;
  }
  return static_cast<double>(hits) / kRays;
}

TEST(ThroughBox, IsThePartOfCosineWeightedRaysThatMeetIt) {
  std::mt19937 random(5);
  std::uniform_real_distribution<float> number(-1.0F, 1.0F);
  int seen = 0;
  for (int i = 0; i < 120; ++i) {
    const glm::vec3 centre(number(random), number(random), number(random)), origin(number(random), number(random), 0);
    const glm::vec3 half = 0.05F + 0.3F * glm::abs(glm::vec3(number(random), number(random), number(random)));
    const auto normal = glm::normalize(glm::vec3(number(random), number(random), number(random)) + glm::vec3(1e-3F));
    const scene::ChangedBox box{centre - half, centre + half};
    const bool inside = std::ranges::all_of(
        std::array{0, 1, 2}, [&](int axis) { return origin[axis] >= box.low[axis] && origin[axis] <= box.high[axis]; });
    const double expected = inside ? 1.0 : byRays(origin, normal, box, random);
    EXPECT_NEAR(throughBox(origin, normal, box), expected, 0.012) << i;
    seen += expected > 0.05 ? 1 : 0;
  }
  EXPECT_GT(seen, 10);
}

TEST(ThroughBox, BehindAPatchIsNothing) {
  EXPECT_EQ(throughBox({0, 0, 0}, {0, 1, 0}, {{-1, -2, -1}, {1, -1, 1}}), 0.0);
  EXPECT_NEAR(throughBox({0, 0, 0}, {0, 1, 0}, {{-1e3F, 1, -1e3F}, {1e3F, 2, 1e3F}}), 1.0, 1e-4);
}

TEST(ChangeReach, FallsWithTheDistanceOfWhatChanged) {
  const scene::ChangedBox patch{{-0.01F, 0, -0.01F}, {0.01F, 0, 0.01F}};
  double last = HUGE_VAL;
  for (const float height : {0.001F, 0.1F, 0.3F, 0.9F}) {
    const scene::ChangedBox box{{-0.05F, height, -0.05F}, {0.05F, height + 0.1F, 0.05F}};
    const double reach = changeReach({0, 0, 0}, {0, 1, 0}, patch, 4e-4, {&box, 1});
    EXPECT_LT(reach, last);
    last = reach;
  }
  EXPECT_LT(last, 1e-3);
  EXPECT_EQ(changeReach({0, 0, 0}, {0, 1, 0}, patch, 4e-4, {}), 0.0);
}

}  // namespace
}  // namespace radiosity::solver
