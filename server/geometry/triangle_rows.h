// Rows of a grid that a triangle passes through, and where: what walks over all of a triangle's bounds takes the square
// of what slivers across a chart need. Pure functions, any thread.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <glm/vec2.hpp>
#include <limits>

namespace radiosity::scene {

/// Extent along x of the part of a triangle whose y is in [low, high]; empty where x > y.
[[nodiscard]] inline glm::dvec2 extentWithin(const std::array<glm::dvec2, 3>& t, double low, double high) {
  glm::dvec2 extent(std::numeric_limits<double>::infinity(), -std::numeric_limits<double>::infinity());
  const auto add = [&](double x) { extent = {std::min(extent.x, x), std::max(extent.y, x)}; };
  for (std::size_t k = 0; k < 3; ++k) {
    const auto &a = t[k], &b = t[(k + 1) % 3];
    if (a.y >= low && a.y <= high) add(a.x);
    for (const double y : {low, high})
      if ((a.y < y) != (b.y < y))
        add(std::clamp(a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y), std::min(a.x, b.x), std::max(a.x, b.x)));
  }
  return extent;
}

/// Whole numbers from `first` to before `end`.
struct Columns {
  int first, end;
};

/// Of cells of a row from y to y + 1, `width` in all, those whose middles may lie in the triangle or within a tenth of
/// a cell of it. Others beside them are among them.
[[nodiscard]] inline Columns columnsOf(const std::array<glm::dvec2, 3>& t, int y, int width) {
  constexpr double kNear = 0.1;
  const auto extent = extentWithin(t, y + 0.5 - kNear, y + 0.5 + kNear);
  if (!(extent.x <= extent.y)) return {0, 0};
  const auto most = static_cast<double>(width);
  return {static_cast<int>(std::clamp(std::floor(extent.x) - 1.0, 0.0, most)),
          static_cast<int>(std::clamp(std::ceil(extent.y) + 1.0, 0.0, most))};
}

}  // namespace radiosity::scene
