#include "server/solver/math/microfacets.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace radiosity::solver {
namespace {

const glm::dvec3 kUp(0.0, 0.0, 1.0);

glm::dvec3 downAt(double angle) { return {std::sin(angle), 0.0, -std::cos(angle)}; }

TEST(Microfacets, ASmoothMirrorReflectsAtTheAngleAtWhichLightComes) {
  const auto reflection = reflectByMicrofacets(kUp, downAt(0.5), 0.0, 1);
  EXPECT_NEAR(glm::distance(reflection.direction, {std::sin(0.5), 0.0, std::cos(0.5)}), 0.0, 1e-12);
  ASSERT_EQ(reflection.count, 1U);
  EXPECT_NEAR(reflection.edge[0], std::pow(1.0 - std::cos(0.5), 5.0), 1e-12);
}

TEST(Microfacets, LightLeavesAboveTheSurfaceHoweverRoughItIs) {
  const auto normal = glm::normalize(glm::dvec3(0.3, -0.7, 0.2));
  for (const double roughness : {0.1, 0.5, 1.0}) {
    for (std::uint64_t key = 0; key < 2000; ++key) {
      const auto way = glm::normalize(glm::dvec3(std::cos(double(key)), 0.3, std::sin(double(key))) - normal);
      if (glm::dot(way, normal) >= 0.0) continue;
      const auto reflection = reflectByMicrofacets(normal, way, roughness, key);
      EXPECT_GT(glm::dot(reflection.direction, normal), 0.0);
      EXPECT_NEAR(glm::length(reflection.direction), 1.0, 1e-9);
      EXPECT_GE(reflection.count, 1U);
    }
  }
}

/// Part of the rays that come at one angle from the normal that leave within a cone about another, at whatever azimuth.
double partBetween(double from, double low, double high, double roughness) {
  constexpr int kRays = 200'000;
  int hits = 0;
  for (int i = 0; i < kRays; ++i) {
    const auto out = reflectByMicrofacets(kUp, downAt(from), roughness, static_cast<std::uint64_t>(i));
    const double angle = std::acos(std::min(1.0, out.direction.z));
    hits += angle >= low && angle < high ? 1 : 0;
  }
  return static_cast<double>(hits) / kRays;
}

// As much light goes one way as the other: what comes from a ring of directions weighs as its cosine and solid angle.
TEST(Microfacets, AsMuchGoesOneWayAsTheOther) {
  constexpr double kWidth = 0.1, kA = 0.4, kB = 1.1;
  for (const double roughness : {0.6, 1.0}) {
    const auto ring = [&](double angle) { return std::cos(angle) * std::sin(angle); };
    double there = 0.0, back = 0.0;
    for (int i = 0; i < 4; ++i) {
      const double off = kWidth * (i - 1.5) / 4.0;
      there += ring(kA + off) * partBetween(kA + off, kB - kWidth / 2, kB + kWidth / 2, roughness) / 4.0;
      back += ring(kB + off) * partBetween(kB + off, kA - kWidth / 2, kA + kWidth / 2, roughness) / 4.0;
    }
    EXPECT_NEAR(there / back, 1.0, 0.03) << roughness;
  }
}

// A histogram of what leaves after one bounce, against the density; half a million rays tell each cell to 1 %.
TEST(Microfacets, OneBounceLeavesAsItsDensityTells) {
  constexpr int kRays = 500'000, kCells = 6, kGrid = 60;
  for (const double roughness : {0.4, 0.8}) {
    for (const double angle : {0.2, 1.2}) {
      std::array<double, kCells> found{}, expected{};
      for (int i = 0; i < kRays; ++i) {
        const auto out = reflectByMicrofacets(kUp, downAt(angle), roughness, static_cast<std::uint64_t>(i));
        if (out.count != 1) continue;
        found[static_cast<std::size_t>(std::min(kCells - 1.0, kCells * out.direction.z))] += 1.0 / kRays;
        const auto once = bounceOnce(kUp, downAt(angle), out.direction, roughness);
        ASSERT_NEAR(once.edge, out.edge[0], 1e-6);
      }
      for (int i = 0; i < kCells * kGrid; ++i) {
        const double z = (i + 0.5) / (kCells * kGrid), across = std::sqrt(1.0 - z * z);
        for (int k = 0; k < 8 * kGrid; ++k) {
          const double turn = 2.0 * std::numbers::pi * (k + 0.5) / (8 * kGrid);
          const glm::dvec3 out(across * std::cos(turn), across * std::sin(turn), z);
          expected[static_cast<std::size_t>(i / kGrid)] += bounceOnce(kUp, downAt(angle), out, roughness).density *
                                                           2.0 * std::numbers::pi / (8 * kGrid) / (kCells * kGrid);
        }
      }
      for (std::size_t i = 0; i < kCells; ++i)
        EXPECT_NEAR(found[i], expected[i], 0.002 + 0.01 * expected[i]) << roughness << ' ' << angle << ' ' << i;
    }
  }
}

TEST(Microfacets, APerfectMirrorHasNoDensity) {
  EXPECT_EQ(bounceOnce(kUp, downAt(0.5), {std::sin(0.5), 0.0, std::cos(0.5)}, 0.0).density, 0.0);
}

}  // namespace
}  // namespace radiosity::solver
