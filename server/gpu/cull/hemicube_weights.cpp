#include "server/gpu/cull/hemicube_weights.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <span>

#include "common/check.h"
#include "server/gpu/gl/shader_constants.h"

namespace radiosity::gpu {
namespace {

/// Edges of `count` cells whose samples lie at first + (i + phase) step.
std::vector<double> cellEdges(double first, double last, std::uint32_t count, double phase) {
  const double step = (last - first) / count;
  std::vector<double> edges(count + 1);
  for (std::uint32_t i = 0; i <= count; ++i) edges[i] = first + (i + phase - 0.5) * step;
  edges.front() = first;
  edges.back() = last;
  return edges;
}

/// Cell weights of a face from its corner function, row-major.
template <typename Corner>
std::vector<double> faceWeights(const std::vector<double>& across, const std::vector<double>& up, Corner corner) {
  const std::size_t width = across.size() - 1;
  std::vector<double> below(across.size()), above(across.size()), cells;
  cells.reserve(width * (up.size() - 1));
  for (std::size_t i = 0; i <= width; ++i) below[i] = corner(across[i], up[0]);
  for (std::size_t row = 1; row < up.size(); ++row) {
    for (std::size_t i = 0; i <= width; ++i) above[i] = corner(across[i], up[row]);
    for (std::size_t i = 0; i < width; ++i) cells.push_back((above[i + 1] - above[i]) - (below[i + 1] - below[i]));
    std::swap(below, above);
  }
  return cells;
}

/// Rounds weights to integers that sum to `total` (largest remainders get the rest; ties go to the first pixel).
std::vector<std::uint32_t> apportion(const std::vector<double>& weights, std::uint32_t total) {
  const double scale = total / std::accumulate(weights.begin(), weights.end(), 0.0);
  std::vector<std::uint32_t> integers(weights.size());
  std::vector<float> remainder(weights.size());
  std::uint64_t given = 0;
  for (std::size_t i = 0; i < weights.size(); ++i) {
    const double exact = std::max(0.0, weights[i] * scale);
    integers[i] = static_cast<std::uint32_t>(exact);
    remainder[i] = static_cast<float>(exact - integers[i]);
    given += integers[i];
  }
  RAD_CHECK_LE(given, std::uint64_t{total});
  const std::size_t rest = total - given;
  RAD_CHECK_LE(rest, weights.size());
  std::vector<std::uint32_t> order(weights.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto larger = [&](std::uint32_t a, std::uint32_t b) {
    return remainder[a] != remainder[b] ? remainder[a] > remainder[b] : a < b;
  };
  std::nth_element(order.begin(), order.begin() + static_cast<std::ptrdiff_t>(rest), order.end(), larger);
  for (const auto i : std::span(order).first(rest)) ++integers[i];
  return integers;
}

}  // namespace

std::array<double, 2> latticePhase(std::uint32_t lattice) {
  RAD_CHECK_LT(lattice, solver::kLatticeSide * solver::kLatticeSide);
  return {(lattice % solver::kLatticeSide + 0.5) / solver::kLatticeSide,
          (lattice / solver::kLatticeSide + 0.5) / solver::kLatticeSide};
}

double topCorner(double x, double y) {
  const double rx = std::sqrt(1.0 + x * x);
  const double ry = std::sqrt(1.0 + y * y);
  return (x / rx * std::atan(y / rx) + y / ry * std::atan(x / ry)) / (2.0 * std::numbers::pi);
}

double sideCorner(double y, double z) {
  const double rz = std::sqrt(1.0 + z * z);
  return (std::atan(y) - std::atan(y / rz) / rz) / (2.0 * std::numbers::pi);
}

HemicubeWeights computeWeights(std::uint32_t resolution, std::uint32_t lattice) {
  RAD_CHECK(resolution % 2 == 0 && resolution >= kMinResolution && resolution <= kMaxResolution);
  const auto [across, up] = latticePhase(lattice);
  const auto columns = cellEdges(-1.0, 1.0, resolution, across);
  // Four equal side faces must leave an integer for the top.
  const auto side_total = static_cast<std::uint32_t>(std::lround(2.0 * sideCorner(1.0, 1.0) * solver::kWeightOne));
  const auto top = apportion(faceWeights(columns, cellEdges(-1.0, 1.0, resolution, up), topCorner),
                             solver::kWeightOne - 4 * side_total);
  const auto side = apportion(faceWeights(columns, cellEdges(0.0, 1.0, resolution / 2, up), sideCorner), side_total);

  HemicubeWeights weights;
  weights.before.reserve(hemicubePixels(resolution) + 1);
  weights.before.push_back(0);
  for (int face = 0; face < RAD_FACES; ++face) {
    for (const auto weight : face == 0 ? top : side) weights.before.push_back(weights.before.back() + weight);
  }
  RAD_CHECK_EQ(weights.before.back(), solver::kWeightOne);
  return weights;
}

const HemicubeWeights& WeightCache::get(std::uint32_t resolution, std::uint32_t lattice) {
  auto& table = [&]() -> Table& {
    const std::lock_guard lock(mutex_);
    return tables_[{resolution, lattice}];  // stays where it is, whatever comes beside it
  }();
  std::call_once(table.made, [&] { table.weights = computeWeights(resolution, lattice); });
  return table.weights;
}

}  // namespace radiosity::gpu
