#include "server/solver/reflected/direct_smoothing.h"

#include <algorithm>
#include <iterator>
#include <numeric>

#include "common/parallel.h"
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

/// Square of what the mean of the halves is off by as far as their difference tells, times area. `light`: of a half,
/// a channel and a leaf value.
template <typename Light>
double noiseOf(const Side& side, std::span<const float> area, const Light& light) {
  double sum = 0.0;
  for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const float off = light(0, channel, value) - light(1, channel, value);
      sum += 0.25 * static_cast<double>(area[value] * off * off);
    }
  }
  return sum;
}

/// By channel, as LeafSmoother has it.
std::array<LeafSmoother::Light, 2> planesOf(const DirectSmoothing::Halves& halves) {
  std::array<LeafSmoother::Light, 2> planes;
  inBothHalves([&](std::size_t half) {
    for (std::size_t channel = 0; channel < 3; ++channel) {
      auto& plane = planes[half][channel];
      plane.reserve(halves[half].size());
      for (const auto& light : halves[half]) plane.push_back(light[static_cast<int>(channel)]);
    }
  });
  return planes;
}

}  // namespace

void DirectSmoothing::smooth(const std::vector<Side>& sides, std::span<const float> area,
                             const std::function<bool(std::uint32_t)>& is_parted, Halves& halves) {
  std::vector<Side> wide;
  std::ranges::copy_if(sides, std::back_inserter(wide),
                       [](const Side& side) { return std::min(side.width, side.height) > kNarrow; });
  leaf_bias_.assign(area.size(), 0.0F);
  auto planes = planesOf(halves);
  LeafSmoother smoother(wide, area, is_parted);
  smoother.smooth(planes);
  const auto biases = smoother.biasOfLeaves();
  std::vector<double> of_side(wide.size(), 0.0);
  const auto takeSide = [&](std::size_t s) {
    const auto& side = wide[s];
    const auto first = side.first_value, end = side.first_value + side.leaf_count;
    double bias = 0.0;
    for (auto value = first; value < end; ++value) bias += static_cast<double>(area[value] * biases[value]);
    const double before = noiseOf(side, area, [&](std::size_t half, std::size_t channel, std::size_t value) {
      return halves[half][value][static_cast<int>(channel)];
    });
    const double after = noiseOf(side, area, [&](std::size_t half, std::size_t channel, std::size_t value) {
      return planes[half][channel][value];
    });
    if (after + bias > kWorthwhile * before) return;
    std::copy_n(biases.begin() + first, side.leaf_count, leaf_bias_.begin() + first);
    for (std::size_t half = 0; half < 2; ++half)
      for (auto value = first; value < end; ++value)
        halves[half][value] = {planes[half][0][value], planes[half][1][value], planes[half][2][value]};
    of_side[s] = bias + stateMore(side, area, kLeastLeft * before - after - bias);
  };
  inTurns(wide.size(), takeSide);
  bias_ = std::reduce(of_side.begin(), of_side.end(), 0.0);
}

/// Where that is above 0. Returns what is stated more.
double DirectSmoothing::stateMore(const Side& side, std::span<const float> area, double square) {
  const auto of_side = area.subspan(side.first_value, side.leaf_count);
  const double all = std::reduce(of_side.begin(), of_side.end(), 0.0);
  if (!(square > 0.0 && all > 0.0)) return 0.0;
  for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value)
    leaf_bias_[value] += area[value] > 0.0F ? static_cast<float>(square / all) : 0.0F;
  return square;
}

}  // namespace radiosity::solver
