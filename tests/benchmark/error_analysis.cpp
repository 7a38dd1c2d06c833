#include "tests/benchmark/error_analysis.h"

#include <algorithm>
#include <cmath>

namespace radiosity::benchmark {

std::optional<double> logLogSlope(std::span<const ErrorAtTime> curve) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const auto& point : curve) {
    if (!(point.seconds > 0.0 && point.error > 0.0)) continue;
    const double t = std::log(point.seconds), e = std::log(point.error);
    n += 1, x += t, y += e, xx += t * t, xy += t * e;
  }
  const double spread = n * xx - x * x;
  if (n < 2 || !(spread > 1e-12)) return {};
  return (n * xy - x * y) / spread;
}

std::optional<TimeToError> timeToError(std::span<const ErrorAtTime> curve, double error,
                                       std::optional<double> exponent) {
  for (std::size_t i = 0; i < curve.size(); ++i) {
    const auto& below = curve[i];
    if (below.error > error) continue;
    if (i == 0) return TimeToError{below.seconds, TimeToError::Kind::kAtMost};
    const auto& above = curve[i - 1];
    // an error of exactly zero has no logarithm: a tenth of a per mille of the goal stands for it
    const double low = std::log(std::max(below.error, 1e-4 * error));
    const double share = (std::log(above.error) - std::log(error)) / (std::log(above.error) - low);
    const double seconds = above.seconds * std::pow(below.seconds / above.seconds, share);
    return TimeToError{seconds, TimeToError::Kind::kBetween};
  }
  if (!exponent || curve.empty()) return {};
  const auto& last = curve.back();
  return TimeToError{last.seconds * std::pow(error / last.error, 1.0 / *exponent), TimeToError::Kind::kExtrapolated};
}

std::optional<LinearCost> fitLinearCost(std::span<const TimedSamples> runs) {
  double w = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const auto& run : runs) {
    if (!(run.seconds > 0.0)) continue;
    const double weight = 1.0 / (run.seconds * run.seconds);
    w += weight, x += weight * run.samples, y += weight * run.seconds;
    xx += weight * run.samples * run.samples, xy += weight * run.samples * run.seconds;
  }
  const double spread = w * xx - x * x;
  if (!(spread > 1e-12 * w * xx)) return {};
  const double slope = std::max(0.0, (w * xy - x * y) / spread);
  return LinearCost{std::max(0.0, (y - slope * x) / w), slope};
}

std::optional<double> geometricMean(std::span<const double> values) {
  double sum = 0.0, count = 0.0;
  for (const double value : values) {
    if (value > 0.0) sum += std::log(value), count += 1.0;
  }
  if (!(count > 0.0)) return {};
  return std::exp(sum / count);
}

}  // namespace radiosity::benchmark
