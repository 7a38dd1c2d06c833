#include "tests/oracle/error_metrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/oracle/random.h"

namespace radiosity::oracle {
namespace {

TEST(ErrorMetrics, UniformScaleIsBiasMedianAndRmsAlike) {
  std::vector<Comparison> comparisons;
  for (int i = 1; i < 50; ++i) {
    const glm::dvec3 reference(i, 2 * i, 0.5 * i);
    comparisons.push_back({1.1 * reference, reference, glm::dvec3(0.0), 1.0 / i});
  }
  const auto metrics = measureError(comparisons);
  for (const double figure : {metrics.relative_rms, metrics.mean, metrics.median, metrics.p99, metrics.bias}) {
    EXPECT_NEAR(figure, 0.1, 1e-12);
  }
  EXPECT_EQ(metrics.count, 49U);
}

TEST(ErrorMetrics, AreaDecidesTheMedian) {
  const glm::dvec3 one(1.0);
  const auto metrics = measureError(
      std::vector<Comparison>{{1.5 * one, one, {}, 1.0}, {1.4 * one, one, {}, 1.0}, {0.99 * one, one, {}, 10.0}});
  EXPECT_NEAR(metrics.median, 0.01, 1e-12);
  EXPECT_NEAR(metrics.p99, 0.5, 1e-12);
}

TEST(ErrorMetrics, WeightlessAndDarkEntriesDoNotSpoilTheRest) {
  const glm::dvec3 one(1.0);
  const auto metrics = measureError(std::vector<Comparison>{
      {one, one, {}, 1.0}, {5.0 * one, one, {}, 0.0}, {glm::dvec3(0.0), glm::dvec3(0.0), {}, 1.0}});
  EXPECT_EQ(metrics.relative_rms, 0.0);
  EXPECT_EQ(metrics.p99, 0.0);
}

// A hundredth of the mean and less is dark: a leak there is an error of RMS, not one of so many thousand percent.
TEST(ErrorMetrics, WhatIsNearlyBlackHasNoRelativeError) {
  const glm::dvec3 one(1.0);
  const auto metrics = measureError(std::vector<Comparison>{{one, one, {}, 1.0}, {0.5 * one, 1e-9 * one, {}, 1.0}});
  EXPECT_EQ(metrics.p99, 0.0);
  EXPECT_NEAR(metrics.relative_rms, 0.5, 1e-6);
}

TEST(ErrorMetrics, ReferenceNoiseIsTakenOutInSquares) {
  const glm::dvec3 one(1.0);
  const auto metrics = measureError(std::vector<Comparison>{{1.05 * one, one, 0.03 * one, 1.0}});
  EXPECT_NEAR(metrics.reference_noise, 0.03, 1e-12);
  EXPECT_NEAR(metrics.solverRms(), 0.04, 1e-12);
}

// 2,000 texels are 1 % wrong, and the reference three times as noisy: in 300 references the range holds the 1 % as
// often as one standard error should, 68 times in 100, to 2.7 (one standard error of that) times three.
TEST(ErrorMetrics, TheRangeHoldsTheTruthTwoTimesInThree) {
  Random random(5);
  const auto gauss = [&] {
    return std::sqrt(-2.0 * std::log(1.0 - random.uniform())) * std::cos(2 * M_PI * random.uniform());
  };
  const glm::dvec3 one(1.0);
  std::size_t held = 0;
  for (int trial = 0; trial < 300; ++trial) {
    std::vector<Comparison> comparisons(2000);
    for (auto& c : comparisons) {
      c.reference = one + 0.03 * glm::dvec3(gauss(), gauss(), gauss());
      c.value = one + 0.01 * (random.uniform() < 0.5 ? one : -one);
      c.standard_error = 0.03 * one;
      c.weight = 1.0;
    }
    const auto [low, high] = measureError(comparisons).solverRange();
    held += low <= 0.01 && 0.01 <= high ? 1 : 0;
  }
  EXPECT_NEAR(static_cast<double>(held) / 300.0, 0.683, 3 * 0.027);
}

TEST(ErrorMetrics, NothingToCompareGivesZeros) {
  const auto metrics = measureError({});
  EXPECT_EQ(metrics.count, 0U);
  EXPECT_EQ(metrics.solverRms(), 0.0);
}

}  // namespace
}  // namespace radiosity::oracle
