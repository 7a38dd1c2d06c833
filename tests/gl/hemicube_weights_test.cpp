#include "server/gpu/cull/hemicube_weights.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace radiosity::gpu {
namespace {

TEST(HemicubeWeights, FacesSumToOne) {
  EXPECT_NEAR(4 * topCorner(1, 1), 0.554126, 1e-6);
  EXPECT_NEAR(2 * sideCorner(1, 1), 0.111468, 1e-6);
  EXPECT_NEAR(4 * topCorner(1, 1) + 8 * sideCorner(1, 1), 1.0, 1e-14);
}

TEST(HemicubeWeights, IntegersSumToExactlyOneForEveryLattice) {
  for (const auto resolution : {4U, 16U, 64U, 130U, 256U}) {
    for (std::uint32_t lattice = 0; lattice < 16; ++lattice) {
      const auto weights = computeWeights(resolution, lattice);
      ASSERT_EQ(weights.before.size(), hemicubePixels(resolution) + 1);
      EXPECT_EQ(weights.before.back(), solver::kWeightOne);
      EXPECT_TRUE(std::is_sorted(weights.before.begin(), weights.before.end()));
    }
  }
}

/// Edges of cell i of `count` cells from `first` to `last`.
std::array<double, 2> cell(double first, double last, std::uint32_t count, double phase, std::uint32_t i) {
  const double step = (last - first) / count;
  return {i == 0 ? first : first + (i + phase - 0.5) * step, i + 1 == count ? last : first + (i + phase + 0.5) * step};
}

template <typename Density>
double integrate(std::array<double, 2> across, std::array<double, 2> up, Density density) {
  constexpr int kSteps = 200;
  double sum = 0.0;
  for (int i = 0; i < kSteps; ++i) {
    for (int j = 0; j < kSteps; ++j) {
      sum += density(across[0] + (across[1] - across[0]) * (i + 0.5) / kSteps,
                     up[0] + (up[1] - up[0]) * (j + 0.5) / kSteps);
    }
  }
  return sum * (across[1] - across[0]) * (up[1] - up[0]) / (kSteps * kSteps);
}

TEST(HemicubeWeights, EqualBruteForceIntegralsOfTheCosineOverEachCell) {
  constexpr std::uint32_t kResolution = 8;
  for (const std::uint32_t lattice : {0U, 6U, 13U}) {
    const auto weights = computeWeights(kResolution, lattice);
    const auto [across, up] = latticePhase(lattice);
    for (std::uint32_t row = 0; row < 2 * kResolution; ++row) {
      for (std::uint32_t i = 0; i < kResolution; ++i) {
        const bool top = row < kResolution;
        const auto x = cell(-1, 1, kResolution, across, i);
        const auto y = top ? cell(-1, 1, kResolution, up, row)
                           : cell(0, 1, kResolution / 2, up, (row - kResolution) % (kResolution / 2));
        const double exact = integrate(x, y, [&](double a, double b) {
          const double square = 1 + a * a + b * b;
          return (top ? 1.0 : b) / (std::numbers::pi * square * square);
        });
        EXPECT_NEAR(weights.pixel(row * kResolution + i) / static_cast<double>(solver::kWeightOne), exact,
                    2e-6 * exact + 2e-9)
            << "lattice " << lattice << " row " << row << " column " << i;
      }
    }
  }
}

TEST(HemicubeWeights, SamplesCoverTheLatticeEvenly) {
  double sum_x = 0.0;
  double sum_y = 0.0;
  for (std::uint32_t lattice = 0; lattice < 16; ++lattice) {
    const auto [x, y] = latticePhase(lattice);
    EXPECT_GT(x, 0.0);
    EXPECT_LT(y, 1.0);
    sum_x += x;
    sum_y += y;
  }
  EXPECT_DOUBLE_EQ(sum_x, 8.0);
  EXPECT_DOUBLE_EQ(sum_y, 8.0);
}

}  // namespace
}  // namespace radiosity::gpu
