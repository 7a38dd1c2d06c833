#include "server/solver/reflected/direct_smoothing.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "server/solver/math/halves.h"
#include "server/solver/reflected/leaf_smoother.h"

namespace radiosity::solver {
namespace {

/// Of the square of what a side is off by, smoothing is to leave less than this: what it says that it costs is an
/// estimate. On sides of so few leaves across it would be most of the error, however many points look.
constexpr double kWorthwhile = 0.8;
constexpr std::uint32_t kNarrow = 12;
/// So much of the square is said to be left at least. Of leaves of which few points know, the halves agree with their
/// neighbours' mean where both know nothing: of a cube in which two rays met a leaf 9 % were stated, and 17 % true.
constexpr double kLeastLeft = 0.25;

/// Square of what the mean of the halves is off by as far as their difference tells, times area.
double noiseOf(const Side& side, std::span<const float> area, const DirectSmoothing::Halves& halves) {
  double sum = 0.0;
  for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value) {
    const auto off = halves[0][value] - halves[1][value];
    sum += 0.25 * static_cast<double>(area[value] * glm::dot(off, off));
  }
  return sum;
}

}  // namespace

/// Where that is above 0. Returns what is stated more.
double DirectSmoothing::stateMore(const Side& side, std::span<const float> area, double square) {
  const auto of_side = area.subspan(side.first_value, side.leaf_count);
  const double all = std::reduce(of_side.begin(), of_side.end(), 0.0);
  if (!(square > 0.0 && all > 0.0)) return 0.0;
  for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value)
    leaf_bias_[value] += area[value] > 0.0F ? static_cast<float>(square / all) : 0.0F;
  return square;
}

void DirectSmoothing::smooth(const std::vector<Side>& sides, std::span<const float> area,
                             const std::function<bool(std::uint32_t)>& is_parted, Halves& halves) {
  std::array<LeafSmoother::Light, 2> planes;
  inBothHalves([&](std::size_t half) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      auto& plane = planes[half][channel];
      plane.reserve(halves[half].size());
      for (const auto& light : halves[half]) plane.push_back(light[static_cast<int>(channel)]);
    }
  });
  LeafSmoother smoother(sides, area, is_parted);
  smoother.smooth(planes);
  leaf_bias_ = smoother.biasOfLeaves();
  const auto raw = std::exchange(halves, {});
  inBothHalves([&](std::size_t half) {
    halves[half].resize(raw[half].size());
    for (std::size_t value = 0; value < halves[half].size(); ++value)
      halves[half][value] = {planes[half][0][value], planes[half][1][value], planes[half][2][value]};
  });
  bias_ = 0.0;
  for (const auto& side : sides) {
    double bias = 0.0;
    for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value)
      bias += static_cast<double>(area[value] * leaf_bias_[value]);
    const bool is_wide = std::min(side.width, side.height) > kNarrow;
    const double before = noiseOf(side, area, raw), after = noiseOf(side, area, halves);
    if (is_wide && after + bias <= kWorthwhile * before) {
      bias_ += bias + stateMore(side, area, kLeastLeft * before - after - bias);
      continue;
    }
    std::fill_n(leaf_bias_.begin() + side.first_value, side.leaf_count, 0.0F);
    for (std::size_t half = 0; half < 2; ++half)
      std::copy_n(raw[half].begin() + side.first_value, side.leaf_count, halves[half].begin() + side.first_value);
  }
}

}  // namespace radiosity::solver
