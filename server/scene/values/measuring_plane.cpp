#include "server/scene/values/measuring_plane.h"

#include <algorithm>
#include <cmath>

namespace radiosity::scene {
namespace {

constexpr double kWidestCell = 10.0;
/// No number of cells is larger: what is made of it still fits 64 bits, and is far above what is allowed.
constexpr double kMostCells = 1e9;

std::uint64_t wholeCells(double cells) {
  return static_cast<std::uint64_t>(std::clamp(std::round(cells), 1.0, kMostCells));
}

}  // namespace

PlaneGrid usualGrid(double width, double depth) {
  const double longer = std::max(width, depth), shorter = std::min(width, depth);
  constexpr double kRounding = 1e-6;  // a plane of 2 : 1 has one grid however it is turned
  const bool is_strip = longer >= (2.0 - kRounding) * shorter;
  const double side = is_strip ? shorter : longer, other = is_strip ? longer : shorter;
  const double wanted = std::min(kWidestCell, 0.2 * std::pow(5.0, std::log10(side)));
  const auto cells = wholeCells(side / wanted);
  const auto others = wholeCells(other * static_cast<double>(cells) / side);
  return (side == width) ? PlaneGrid{cells, others} : PlaneGrid{others, cells};
}

}  // namespace radiosity::scene
