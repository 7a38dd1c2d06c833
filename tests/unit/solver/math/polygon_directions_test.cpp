// Directions to a polygon come as its light does: of those drawn, the part that meets each piece of the polygon is the
// piece's part of the form factor, which Lambert's formula gives.
#include "server/solver/math/polygon_directions.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <random>
#include <vector>

#include "server/solver/math/polygon_form_factor.h"

namespace radiosity::solver {
namespace {

/// Of a rectangle in z = 0, as seen from `at`: how far the counts in a grid of pieces lie from what the form factors
/// say, in standard deviations squared, for each piece (chi squared divided by the degrees of freedom).
double misfit(const glm::dvec3& at, const glm::dvec3& normal, const glm::vec2& low, const glm::vec2& high) {
  constexpr int kPieces = 6, kDraws = 20000;
  const auto size = (high - low) / static_cast<float>(kPieces);
  const auto rectangle = [](const glm::vec2& a, const glm::vec2& b) {
    return std::vector<glm::vec3>{{a.x, a.y, 0.0F}, {b.x, a.y, 0.0F}, {b.x, b.y, 0.0F}, {a.x, b.y, 0.0F}};
  };
  const auto whole = rectangle(low, high);
  const PolygonDirections directions(at, normal, whole);
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<int> counts(kPieces * kPieces);
  for (int i = 0; i < kDraws; ++i) {
    const auto direction = directions.draw([&] { return uniform(random); });
    const auto hit = (glm::vec2(at + direction * (-at.z / direction.z)) - low) / size;
    const auto x = std::clamp(static_cast<int>(std::floor(hit.x)), 0, kPieces - 1);
    const auto y = std::clamp(static_cast<int>(std::floor(hit.y)), 0, kPieces - 1);
    EXPECT_NEAR(hit.x, glm::clamp(hit.x, 0.0F, 1.0F * kPieces), 1e-3F);
    EXPECT_NEAR(hit.y, glm::clamp(hit.y, 0.0F, 1.0F * kPieces), 1e-3F);
    ++counts[static_cast<std::size_t>(y * kPieces + x)];
  }
  const double all = polygonFormFactor(at, normal, whole);
  double sum = 0.0;
  int pieces = 0;
  for (int i = 0; i < kPieces * kPieces; ++i) {
    const auto a = low + size * glm::vec2(i % kPieces, i / kPieces);
    const double expected = kDraws * polygonFormFactor(at, normal, rectangle(a, a + size)) / all;
    if (expected < 5.0) continue;  // too few for the normal distribution
    sum += std::pow(counts[static_cast<std::size_t>(i)] - expected, 2.0) / expected;
    ++pieces;
  }
  EXPECT_GT(pieces, 3);
  return sum / (pieces - 1);
}

// Chi squared of 35 degrees of freedom is above 1.9 times these once in a thousand draws; of 5, above 4.
TEST(PolygonDirections, ComeAsTheLightDoes) {
  const glm::dvec3 along(-1, 0, 0);
  EXPECT_LT(misfit({0.0, 0.05, 0.3}, along, {-0.3F, -0.3F}, {0.0F, 0.3F}), 1.9) << "a wall over a floor";
  EXPECT_LT(misfit({0.0, 0.05, 0.02}, along, {-0.02F, -0.3F}, {0.0F, 0.3F}), 4.0) << "near to its foot";
  EXPECT_LT(misfit({0.0, 0.0, 0.5}, {0, 0, -1}, {-0.5F, -0.4F}, {0.6F, 0.7F}), 1.9) << "right over the polygon";
  EXPECT_LT(misfit({0.2, -2.0, 1.0}, glm::normalize(glm::dvec3(-0.6, 0.5, -0.3)), {-1.0F, 0.0F}, {0.0F, 1.0F}), 1.9);
}

TEST(PolygonDirections, OfADistantSpeckGoToIt) {
  const std::vector<glm::vec3> speck{{1000.0F, 0.0F, 0.0F}, {1000.0F, 1e-3F, 0.0F}, {1000.0F, 1e-3F, 1e-3F}};
  const PolygonDirections directions({0, 0, 0}, {1, 0, 0}, speck);
  const auto direction = directions.draw([] { return 0.5; });
  EXPECT_NEAR(direction.x, 1.0, 1e-9);
  EXPECT_NEAR(glm::length(direction), 1.0, 1e-12);
}

TEST(PolygonDirections, OfANeedleAndOfACornerInTheReceiverAreUnitVectors) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  const std::vector<std::vector<glm::vec3>> shapes{
      {{0.0F, 0.0F, 0.0F}, {1.0F, 0.0F, 0.0F}, {1.0F, 1.0F, 0.0F}},                         // from the receiver itself
      {{0.5F, -1.0F, 1e-7F}, {0.5F, 1.0F, 1e-7F}, {0.5F, 1.0F, 0.0F}},                      // a needle
      {{0.5F, -1.0F, 1e-3F}, {0.5F, 1.0F, 1e-3F}, {0.5F, 1.0F, 0.0F}, {0.5F, 1.0F, 0.0F}},  // a corner twice
  };
  for (const auto& shape : shapes) {
    const PolygonDirections directions({0, 0, 0}, {1, 0, 0}, shape);
    for (int i = 0; i < 100; ++i) {
      const auto direction = directions.draw([&] { return uniform(random); });
      EXPECT_NEAR(glm::length(direction), 1.0, 1e-6);
      EXPECT_GE(direction.x, -1e-9);
    }
  }
}

}  // namespace
}  // namespace radiosity::solver
