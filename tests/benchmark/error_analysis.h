// What is read off a curve of error against time: its slope, and when it reaches an error. Pure functions.
#pragma once

#include <optional>
#include <span>

namespace radiosity::benchmark {

struct ErrorAtTime {
  double seconds = 0.0;
  double error = 0.0;  ///< relative RMS: 0.02 is 2 %
};

/// Least squares of log error against log time; nothing with fewer than two points at different times. Non-positive
/// values are left out.
[[nodiscard]] std::optional<double> logLogSlope(std::span<const ErrorAtTime> curve);

struct TimeToError {
  enum class Kind {
    kBetween,       ///< interpolated in log-log between two measurements
    kAtMost,        ///< the first measurement was below it already
    kExtrapolated,  ///< beyond the last measurement, which was above it, by a power law
  };
  double seconds = 0.0;
  Kind kind = Kind::kBetween;
};

/// When the curve, ordered by time, first comes down to `error`. With `exponent` (say -0.5, Monte Carlo) a curve that
/// ends above it is continued from its last point as time^exponent; without, there is no answer.
[[nodiscard]] std::optional<TimeToError> timeToError(std::span<const ErrorAtTime> curve, double error,
                                                     std::optional<double> exponent = {});

struct LinearCost {
  double setup_seconds = 0.0;
  double seconds_a_sample = 0.0;
};
/// Least squares of seconds = setup + samples x cost, each measurement weighted by 1 / seconds^2 (timing noise is
/// relative); neither part is negative. Needs two different sample counts.
struct TimedSamples {
  double samples = 0.0, seconds = 0.0;
};
[[nodiscard]] std::optional<LinearCost> fitLinearCost(std::span<const TimedSamples> runs);

/// Geometric mean of the positive ones; nothing where there are none.
[[nodiscard]] std::optional<double> geometricMean(std::span<const double> values);

}  // namespace radiosity::benchmark
