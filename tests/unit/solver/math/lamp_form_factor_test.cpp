#include "server/solver/math/lamp_form_factor.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>

namespace radiosity::solver {
namespace {

constexpr double kPi = std::numbers::pi;

/// By midpoints over the disc.
double discByPoints(const glm::dvec3& point, const glm::dvec3& normal, double radius, int rings) {
  double sum = 0.0;
  for (int i = 0; i < rings; ++i) {
    const double r = radius * (i + 0.5) / rings;
    const int count = 8 * (i + 1);
    for (int k = 0; k < count; ++k) {
      const double angle = 2.0 * kPi * (k + 0.5) / count;
      const glm::dvec3 way = glm::dvec3(r * std::cos(angle), r * std::sin(angle), 0.0) - point;
      const double arrives = glm::dot(way, normal), leaves = -way.z, square = glm::dot(way, way);
      const double area = 2.0 * kPi * r * (radius / rings) / count;
      if (arrives > 0.0 && leaves > 0.0) sum += arrives * leaves / (square * square) * area / kPi;
    }
  }
  return sum;
}

/// By directions over the hemisphere of the receiver.
double ballByDirections(const glm::dvec3& point, const glm::dvec3& normal, double radius, int rows) {
  const auto helper = std::abs(normal.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const auto s = glm::normalize(glm::cross(helper, normal)), t = glm::cross(normal, s);
  double hit = 0.0;
  for (int i = 0; i < rows; ++i) {
    for (int k = 0; k < rows; ++k) {
      const double u = (i + 0.5) / rows, angle = 2.0 * kPi * (k + 0.5) / rows;
      const auto d = std::sqrt(1.0 - u) * normal + std::sqrt(u) * (std::cos(angle) * s + std::sin(angle) * t);
      const double along = -glm::dot(point, d);
      if (along > 0.0 && glm::dot(point, point) - along * along < radius * radius) hit += 1.0;
    }
  }
  return hit / rows / rows;
}

glm::dvec3 anyDirection(std::mt19937& random) {
  std::normal_distribution<double> normal;
  return glm::normalize(glm::dvec3(normal(random), normal(random), normal(random)));
}

TEST(DiscFormFactor, OnTheAxisItIsTheSquareOfTheSineOfTheRim) {
  for (const double height : {0.01, 0.5, 3.0}) {
    const double exact = 0.49 / (0.49 + height * height);
    EXPECT_NEAR(discFormFactor({0, 0, height}, {0, 0, -1}, {}, {0, 0, 1}, 0.7), exact, 1e-12) << height;
  }
}

TEST(DiscFormFactor, AnywhereItIsWhatItsPointsAddUpTo) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> side(-1.5, 1.5), height(0.2, 1.5);
  int cut = 0;
  for (int i = 0; i < 60; ++i) {
    const glm::dvec3 point(side(random), side(random), height(random));
    const auto normal = anyDirection(random);
    const double exact = discByPoints(point, normal, 1.0, 200);
    EXPECT_NEAR(discFormFactor(point, normal, {}, {0, 0, 1}, 1.0), exact, 2e-4) << i;
    if (exact > 0.0 && exact < 0.02) ++cut;
  }
  EXPECT_GT(cut, 3) << "some are to be cut by the horizon";
}

TEST(DiscFormFactor, IsNothingBehindInThePlaneAndWhereTheReceiverTurnsAway) {
  EXPECT_EQ(discFormFactor({0, 0, -0.5}, {0, 0, 1}, {}, {0, 0, 1}, 1.0), 0.0);
  EXPECT_EQ(discFormFactor({3, 0, 0}, {-1, 0, 0}, {}, {0, 0, 1}, 1.0), 0.0);
  EXPECT_EQ(discFormFactor({0, 0, 0.5}, {0, 0, 1}, {}, {0, 0, 1}, 1.0), 0.0);
  EXPECT_EQ(discFormFactor({0, 0, 0.5}, {0, 0, -1}, {}, {0, 0, 1}, 0.0), 0.0);
}

TEST(BallFormFactor, AboveTheHorizonIsThatOfAPoint) {
  const double cosine = 0.8;
  const glm::dvec3 normal(0.6, 0.0, cosine);
  EXPECT_NEAR(ballFormFactor({0, 0, -2}, normal, {}, 0.5), cosine * 0.25 / 4.0, 1e-15);
}

TEST(BallFormFactor, CutByTheHorizonIsWhatItsDirectionsAddUpTo) {
  std::mt19937 random(9);
  for (int i = 0; i < 40; ++i) {
    const auto normal = anyDirection(random);
    const glm::dvec3 point(0.0, 0.0, -1.2 - 0.05 * i);
    EXPECT_NEAR(ballFormFactor(point, normal, {}, 1.0), ballByDirections(point, normal, 1.0, 400), 2e-3) << i;
  }
}

TEST(BallFormFactor, WithinTheBallItIsBounded) {
  EXPECT_LE(ballFormFactor({0, 0, -0.1}, {0, 0, 1}, {}, 1.0), 1.0);
  EXPECT_EQ(ballFormFactor({}, {0, 0, 1}, {}, 1.0), 0.0);
}

}  // namespace
}  // namespace radiosity::solver
