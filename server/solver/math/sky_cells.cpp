#include "server/solver/math/sky_cells.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace radiosity::solver {
namespace {

using std::numbers::pi;
constexpr double kRowAngle = pi / 2.0 / SkyCells::kRows;

struct Row {
  std::uint32_t first = 0, count = 0;
};

/// As many cells as are about as wide as high.
std::array<Row, SkyCells::kRows> makeRows() {
  std::array<Row, SkyCells::kRows> rows;
  std::uint32_t first = 0;
  for (std::uint32_t r = 0; r < rows.size(); ++r) {
    const double around = 2.0 * pi * std::cos((r + 0.5) * kRowAngle);
    rows[r] = {first, std::max(1U, static_cast<std::uint32_t>(std::lround(around / kRowAngle)))};
    first += rows[r].count;
  }
  // The last takes what is left of the number that is known beforehand.
  rows.back().count = SkyCells::kHalf - rows.back().first;
  return rows;
}

const std::array<Row, SkyCells::kRows>& rows() {
  static const auto made = makeRows();
  return made;
}

}  // namespace

std::uint32_t SkyCells::of(const glm::dvec3& direction) {
  const double altitude = std::asin(std::min(1.0, std::abs(direction.y)));
  const auto& row = rows()[std::min(kRows - 1, static_cast<std::uint32_t>(altitude / kRowAngle))];
  const double turn = std::atan2(direction.z, direction.x) / (2.0 * pi) + 0.5;
  const auto column = std::min(row.count - 1, static_cast<std::uint32_t>(turn * row.count));
  return (direction.y >= 0.0 ? 0 : kHalf) + row.first + column;
}

SkyCells::Extent SkyCells::extentOf(std::uint32_t cell) {
  const auto in_half = cell % kHalf;
  const auto after = std::ranges::upper_bound(rows(), in_half, {}, &Row::first);
  const auto r = static_cast<std::uint32_t>(after - rows().begin() - 1);
  const double low = std::sin(r * kRowAngle), high = r + 1 < kRows ? std::sin((r + 1) * kRowAngle) : 1.0;
  const auto& row = rows()[r];
  const double width = 2.0 * pi / row.count;
  return {(in_half - row.first) * width - pi, width, isAbove(cell) ? low : -high, high - low};
}

glm::dvec3 SkyCells::directionOf(std::uint32_t cell) {
  const auto of = extentOf(cell);
  const double azimuth = of.azimuth + 0.5 * of.width, height = of.height + 0.5 * of.extent;
  const double across = std::sqrt(1.0 - height * height);
  return {across * std::cos(azimuth), height, across * std::sin(azimuth)};
}

}  // namespace radiosity::solver
