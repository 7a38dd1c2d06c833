#include "tests/benchmark/error_analysis.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

namespace radiosity::benchmark {
namespace {

/// error = 0.1 t^-0.5 at the times given.
std::vector<ErrorAtTime> monteCarlo(std::initializer_list<double> times) {
  std::vector<ErrorAtTime> curve;
  for (const double t : times) curve.push_back({t, 0.1 / std::sqrt(t)});
  return curve;
}

TEST(LogLogSlope, IsTheExponentOfAPowerLaw) {
  EXPECT_NEAR(logLogSlope(monteCarlo({0.1, 0.5, 2.0, 30.0})).value(), -0.5, 1e-12);
}

TEST(LogLogSlope, NeedsTwoTimesAndLeavesOutWhatHasNoLogarithm) {
  EXPECT_FALSE(logLogSlope(monteCarlo({1.0})));
  EXPECT_FALSE(logLogSlope(monteCarlo({1.0, 1.0})));
  auto curve = monteCarlo({1.0, 4.0});
  curve.push_back({9.0, 0.0});
  EXPECT_NEAR(logLogSlope(curve).value(), -0.5, 1e-12);
}

TEST(TimeToError, IsExactOnAPowerLawBetweenMeasurements) {
  const auto time = timeToError(monteCarlo({1.0, 10.0, 100.0}), 0.02);
  ASSERT_TRUE(time);
  EXPECT_NEAR(time->seconds, 25.0, 1e-9);
  EXPECT_EQ(time->kind, TimeToError::Kind::kBetween);
}

TEST(TimeToError, IsAnUpperBoundWhenTheFirstMeasurementIsBelow) {
  const auto time = timeToError(monteCarlo({30.0, 60.0}), 0.02);
  ASSERT_TRUE(time);
  EXPECT_EQ(time->seconds, 30.0);
  EXPECT_EQ(time->kind, TimeToError::Kind::kAtMost);
}

TEST(TimeToError, BeyondTheLastMeasurementOnlyByAnExponent) {
  const auto curve = monteCarlo({1.0, 4.0});
  EXPECT_FALSE(timeToError(curve, 0.02));
  const auto time = timeToError(curve, 0.02, -0.5);
  ASSERT_TRUE(time);
  EXPECT_NEAR(time->seconds, 25.0, 1e-9);
  EXPECT_EQ(time->kind, TimeToError::Kind::kExtrapolated);
  EXPECT_FALSE(timeToError({}, 0.02, -0.5));
}

TEST(TimeToError, AnErrorOfZeroStillLiesBetween) {
  const std::array<ErrorAtTime, 2> curve{{{1.0, 0.1}, {2.0, 0.0}}};
  const auto time = timeToError(curve, 0.02);
  ASSERT_TRUE(time);
  EXPECT_GT(time->seconds, 1.0);
  EXPECT_LT(time->seconds, 2.0);
}

TEST(FitLinearCost, FindsSetUpAndCostOfASample) {
  const std::array<TimedSamples, 3> runs{{{1, 0.51}, {16, 0.66}, {256, 3.06}}};
  const auto cost = fitLinearCost(runs);
  ASSERT_TRUE(cost);
  EXPECT_NEAR(cost->setup_seconds, 0.5, 1e-9);
  EXPECT_NEAR(cost->seconds_a_sample, 0.01, 1e-9);
}

TEST(FitLinearCost, IsNeverNegativeAndNeedsTwoSampleCounts) {
  const std::array<TimedSamples, 2> falling{{{1, 2.0}, {4, 1.0}}};
  EXPECT_EQ(fitLinearCost(falling)->seconds_a_sample, 0.0);
  const std::array<TimedSamples, 2> steep{{{1, 0.1}, {4, 1.0}}};
  EXPECT_EQ(fitLinearCost(steep)->setup_seconds, 0.0);
  const std::array<TimedSamples, 2> same{{{4, 1.0}, {4, 1.1}}};
  EXPECT_FALSE(fitLinearCost(same));
}

TEST(GeometricMean, OfPositiveValuesOnly) {
  EXPECT_NEAR(geometricMean(std::array{0.5, 2.0, 0.0, -1.0}).value(), 1.0, 1e-12);
  EXPECT_FALSE(geometricMean(std::array{0.0}));
}

}  // namespace
}  // namespace radiosity::benchmark
