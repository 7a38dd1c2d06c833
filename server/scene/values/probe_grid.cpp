#include "server/scene/values/probe_grid.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

namespace radiosity::scene {
namespace {

/// A side that is a whole number of spacings long has so many cells, whichever way it is rounded.
constexpr double kRounding = 1e-9;

double cellsOf(double side, double spacing) { return std::max(1.0, std::ceil(side / spacing * (1.0 - kRounding))); }

double cellsOf(const ProbeGrid& grid, double spacing) {
  double cells = 1.0;
  for (const auto& side : grid.sides) cells *= cellsOf(glm::length(side), spacing);
  return cells;
}

/// The least that makes few enough, within a hundredth; two digits, rounded up.
double leastSpacing(const ProbeGrid& grid, double low, double most) {
  double high = low;
  while (cellsOf(grid, high) > most) high *= 2.0;
  while (high - low > 0.01 * high) {
    const double middle = 0.5 * (low + high);
    (cellsOf(grid, middle) > most ? low : high) = middle;
  }
  const double digit = std::pow(10.0, std::floor(std::log10(high)) - 1.0);
  return std::ceil(high / digit) * digit;
}

}  // namespace

Result<void> divide(ProbeGrid& grid, double spacing, std::uint64_t others) {
  const auto most = static_cast<double>(kMostProbes - std::min(kMostProbes, others));
  if (const double cells = cellsOf(grid, spacing); !(cells <= most)) {
    const auto rest = others > 0 ? fmt::format(", beside the {} of other grids", others) : std::string();
    const auto advice = most >= 1.0 ? fmt::format("; a spacing of {:.2g} m would do", leastSpacing(grid, spacing, most))
                                    : std::string();
    return fail(ErrorCode::kTooLarge,
                fmt::format("a spacing of {:.4g} m makes {:.3g} probes{}, and there may be {} in all{}", spacing, cells,
                            rest, kMostProbes, advice));
  }
  for (std::size_t axis = 0; axis < 3; ++axis)
    grid.counts[axis] = static_cast<std::uint32_t>(cellsOf(glm::length(grid.sides[axis]), spacing));
  return {};
}

}  // namespace radiosity::scene
