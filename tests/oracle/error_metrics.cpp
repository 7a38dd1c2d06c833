#include "tests/oracle/error_metrics.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

namespace radiosity::oracle {
namespace {

/// A relative error needs something to relate to: this part of the mean.
constexpr double kLeastToRelateTo = 0.01;

double meanLuminance(std::span<const Comparison> comparisons) {
  double sum = 0.0, weight = 0.0;
  for (const auto& c : comparisons) {
    if (!(c.weight > 0.0)) continue;
    sum += c.weight * luminance(c.reference);
    weight += c.weight;
  }
  return weight > 0.0 ? sum / weight : 0.0;
}

/// Smallest error below which `share` of the weight lies.
double quantile(const std::vector<std::pair<double, double>>& sorted, double total_weight, double share) {
  double below = 0.0;
  for (const auto& [error, weight] : sorted) {
    below += weight;
    if (below >= share * total_weight) return error;
  }
  return sorted.empty() ? 0.0 : sorted.back().first;
}

}  // namespace

double luminance(const glm::dvec3& rgb) { return glm::dot(rgb, glm::dvec3(0.2126, 0.7152, 0.0722)); }

double ErrorMetrics::solverRms() const {
  return std::sqrt(std::max(0.0, relative_rms * relative_rms - reference_noise * reference_noise));
}

std::array<double, 2> ErrorMetrics::solverRange() const {
  const double square = relative_rms * relative_rms - reference_noise * reference_noise;
  return {std::sqrt(std::max(0.0, square - square_uncertainty)), std::sqrt(std::max(0.0, square + square_uncertainty))};
}

ErrorMetrics measureError(std::span<const Comparison> comparisons) {
  ErrorMetrics metrics;
  const double least = kLeastToRelateTo * meanLuminance(comparisons);
  double square = 0.0, noise = 0.0, uncertainty = 0.0, reference_square = 0.0, sum = 0.0, reference_sum = 0.0,
         weight_sum = 0.0;
  std::vector<std::pair<double, double>> errors;
  for (const auto& c : comparisons) {
    if (!(c.weight > 0.0)) continue;
    ++metrics.count;
    const auto difference = c.value - c.reference;
    square += c.weight * glm::dot(difference, difference);
    noise += c.weight * glm::dot(c.standard_error, c.standard_error);
    const double excess = glm::dot(difference, difference) - glm::dot(c.standard_error, c.standard_error);
    uncertainty += c.weight * c.weight * excess * excess;
    reference_square += c.weight * glm::dot(c.reference, c.reference);
    const double y = luminance(c.value);
    const double y_reference = luminance(c.reference);
    sum += c.weight * y;
    reference_sum += c.weight * y_reference;
    if (!(y_reference > least)) continue;
    weight_sum += c.weight;
    errors.emplace_back(std::abs(y - y_reference) / y_reference, c.weight);
    metrics.mean += c.weight * errors.back().first;
  }
  if (errors.empty()) return metrics;
  std::sort(errors.begin(), errors.end());
  metrics.relative_rms = std::sqrt(square / reference_square);
  metrics.reference_noise = std::sqrt(noise / reference_square);
  metrics.square_uncertainty = std::sqrt(uncertainty) / reference_square;
  metrics.mean /= weight_sum;
  metrics.median = quantile(errors, weight_sum, 0.5);
  metrics.p99 = quantile(errors, weight_sum, 0.99);
  metrics.bias = sum / reference_sum - 1.0;
  return metrics;
}

}  // namespace radiosity::oracle
