#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numeric>
#include <unordered_map>

#include "common/task.h"
#include "server/scene/charts/charts.h"

namespace radiosity::scene {
namespace {

using Triangle2 = std::array<glm::dvec2, 3>;

constexpr double kMinFacing = 0.5;     // cos 60 degrees: beyond that a projection is too oblique
constexpr double kTieFraction = 1e-6;  // rectangles whose areas differ by less are the same size

double cross2(const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; }
double signedArea(const Triangle2& t) { return 0.5 * cross2(t[1] - t[0], t[2] - t[0]); }

struct Frame {
  glm::dvec3 u, v, n;
};

/// Axes in the plane; the choice does not flip under rounding for planes along the world's axes.
Frame planeFrame(const glm::dvec3& normal) {
  const glm::dvec3 reference = std::abs(normal.x) < 0.9 ? glm::dvec3(1.0, 0.0, 0.0) : glm::dvec3(0.0, 0.0, 1.0);
  const glm::dvec3 u = glm::normalize(reference - normal * glm::dot(reference, normal));
  return {u, glm::cross(normal, u), normal};
}

std::vector<glm::dvec2> convexHull(std::vector<glm::dvec2> points) {
  std::ranges::sort(points, [](const auto& a, const auto& b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  std::vector<glm::dvec2> hull(2 * points.size());
  std::size_t k = 0;
  const auto turn = [&](const glm::dvec2& p) { return cross2(hull[k - 1] - hull[k - 2], p - hull[k - 1]); };
  for (const auto& point : points) {
    while (k >= 2 && turn(point) <= 0.0) --k;
    hull[k++] = point;
  }
  const std::size_t lower = k + 1;
  for (std::size_t i = points.size() - 1; i-- > 0;) {
    while (k >= lower && turn(points[i]) <= 0.0) --k;
    hull[k++] = points[i];
  }
  hull.resize(k - 1);
  return hull;
}

struct Rectangle {
  glm::dvec2 axis{1.0, 0.0};  ///< unit; within 45 degrees of +x
  glm::dvec2 min{0.0}, size{0.0};
};

Rectangle boundsAlong(const std::vector<glm::dvec2>& hull, glm::dvec2 axis) {
  while (std::abs(axis.y) > std::abs(axis.x) * (1.0 + 1e-9)) axis = {axis.y, -axis.x};
  if (axis.x < 0.0) axis = -axis;
  const glm::dvec2 side(-axis.y, axis.x);
  glm::dvec2 low(std::numeric_limits<double>::infinity()), high(-std::numeric_limits<double>::infinity());
  for (const auto& p : hull) {
    const glm::dvec2 q(glm::dot(p, axis), glm::dot(p, side));
    low = glm::min(low, q);
    high = glm::max(high, q);
  }
  return {axis, low, high - low};
}

/// One of the hull's edges lies on the smallest rectangle (Freeman and Shapira 1975). Hulls of charts are small; above
/// 512 edges every k-th is tried, which is within a fraction of a percent of the best.
Rectangle smallestRectangle(const std::vector<glm::dvec2>& points) {
  const std::vector<glm::dvec2> hull = convexHull(points);
  Rectangle best = boundsAlong(hull, {1.0, 0.0});
  double best_area = best.size.x * best.size.y * (1.0 + kTieFraction);  // the axes win ties
  double best_edge = 0.0;
  const std::size_t step = 1 + hull.size() / 512;
  for (std::size_t i = 0; i < hull.size(); i += step) {
    const glm::dvec2 edge = hull[(i + 1) % hull.size()] - hull[i];
    const double length = glm::length(edge);
    if (!(length > 0.0)) continue;
    const Rectangle candidate = boundsAlong(hull, edge / length);
    const double area = candidate.size.x * candidate.size.y;
    const bool smaller = area < best_area * (1.0 - 2.0 * kTieFraction);
    const bool as_small_but_longer =
        best_edge > 0.0 && area < best_area * (1.0 + kTieFraction) && length > best_edge * (1.0 + kTieFraction);
    if (!smaller && !as_small_but_longer) continue;
    best = candidate;
    best_area = area;
    best_edge = length;
  }
  return best;
}

/// Mean normal of the triangles and the worst cosine to it.
std::pair<glm::dvec3, double> meanNormal(const FlatScene& flat, const std::vector<std::uint32_t>& triangles) {
  glm::dvec3 sum(0.0);
  for (const std::uint32_t t : triangles) sum += flat.triangles[t].normal * flat.triangles[t].area;
  const double length = glm::length(sum);
  if (!(length > 0.0)) return {flat.triangles[triangles.front()].normal, -1.0};
  sum /= length;
  double worst = 1.0;
  for (const std::uint32_t t : triangles) worst = std::min(worst, glm::dot(sum, flat.triangles[t].normal));
  return {sum, worst};
}

std::vector<Triangle2> project(const FlatScene& flat, const std::vector<std::uint32_t>& triangles, const Frame& frame) {
  std::vector<Triangle2> result;
  result.reserve(triangles.size());
  for (const std::uint32_t t : triangles) {
    Triangle2 corners;
    for (std::size_t i = 0; i < 3; ++i) {
      const glm::dvec3& p = flat.points[flat.triangles[t].points[i]];
      corners[i] = {glm::dot(p, frame.u), glm::dot(p, frame.v)};
    }
    result.push_back(corners);
  }
  return result;
}

std::vector<glm::dvec2> cornerPoints(const std::vector<Triangle2>& triangles) {
  std::vector<glm::dvec2> points;
  points.reserve(triangles.size() * 3);
  for (const auto& t : triangles) points.insert(points.end(), t.begin(), t.end());
  return points;
}

Chart fitOne(const FlatScene& flat, std::vector<std::uint32_t> triangles, const glm::dvec3& normal, bool planar) {
  Chart chart;
  chart.instance = flat.triangles[triangles.front()].instance;
  chart.planar = planar;
  chart.normal = normal;
  std::ranges::sort(triangles);
  const Frame frame = planeFrame(normal);
  const std::vector<Triangle2> projected = project(flat, triangles, frame);
  const Rectangle rectangle = smallestRectangle(cornerPoints(projected));
  const glm::dvec2 side(-rectangle.axis.y, rectangle.axis.x);
  chart.axis_u = frame.u * rectangle.axis.x + frame.v * rectangle.axis.y;
  chart.axis_v = frame.u * side.x + frame.v * side.y;
  chart.size = rectangle.size;
  for (const auto& triangle : projected) {
    Triangle2 corners;
    for (std::size_t i = 0; i < 3; ++i)
      corners[i] =
          glm::clamp(glm::dvec2(glm::dot(triangle[i], rectangle.axis), glm::dot(triangle[i], side)) - rectangle.min,
                     glm::dvec2(0.0), rectangle.size);
    chart.corners.push_back(corners);
  }
  for (const std::uint32_t t : triangles) chart.area += flat.triangles[t].area;
  chart.triangles = std::move(triangles);
  return chart;
}

/// A chart, or several when the projection folds or overlaps.
void fitGroup(const FlatScene& flat, std::vector<std::uint32_t> triangles, bool planar, std::vector<Chart>& charts) {
  std::vector<std::vector<std::uint32_t>> pending{std::move(triangles)};
  while (!pending.empty()) {
    std::vector<std::uint32_t> group = std::move(pending.back());
    pending.pop_back();
    auto [normal, worst] = meanNormal(flat, group);
    if (planar || group.size() == 1) worst = 1.0;
    if (planar) normal = glm::normalize(normal);
    if (worst < kMinFacing) {
      std::vector<std::uint32_t> facing, averted;
      const glm::dvec3 seed = flat.triangles[group.front()].normal;
      for (const std::uint32_t t : group)
        (glm::dot(flat.triangles[t].normal, seed) >= 0.7 ? facing : averted).push_back(t);
      if (averted.empty()) averted.push_back(facing.back()), facing.pop_back();
      pending.push_back(std::move(averted));
      pending.push_back(std::move(facing));
      continue;
    }
    const std::vector<std::uint32_t> layers = overlapLayers(project(flat, group, planeFrame(normal)));
    const std::uint32_t layer_count = layers.empty() ? 0 : *std::ranges::max_element(layers) + 1;
    if (layer_count <= 1) {
      charts.push_back(fitOne(flat, std::move(group), normal, planar));
      continue;
    }
    std::vector<std::vector<std::uint32_t>> parts(layer_count);
    for (std::size_t i = 0; i < group.size(); ++i) parts[layers[i]].push_back(group[i]);
    for (auto& part : parts) pending.push_back(std::move(part));
  }
}

/// Triangles whose interiors meet, by separating axes with a tolerance relative to the smaller triangle's height.
bool overlaps(const Triangle2& a, const Triangle2& b) {
  const auto separated = [](const Triangle2& p, const Triangle2& q) {
    const double orientation = signedArea(p) < 0.0 ? -1.0 : 1.0;
    for (std::size_t e = 0; e < 3; ++e) {
      const glm::dvec2 edge = (p[(e + 1) % 3] - p[e]) * orientation;
      const double length = glm::length(edge);
      if (!(length > 0.0)) continue;
      double deepest = -std::numeric_limits<double>::infinity();
      for (const auto& corner : q) deepest = std::max(deepest, cross2(edge, corner - p[e]) / length);
      const double height = 2.0 * std::abs(signedArea(p)) / length;
      double reach = 0.0;
      for (const auto& corner : q) reach = std::max(reach, deepest - cross2(edge, corner - p[e]) / length);
      if (deepest <= 1e-3 * std::min(height, reach)) return true;
    }
    return false;
  };
  return !separated(a, b) && !separated(b, a);
}

/// Uniform grid over triangles' bounds; about one triangle a cell.
class OverlapGrid {
 public:
  explicit OverlapGrid(const std::vector<Triangle2>& triangles)
      : triangles_(triangles), layer_(triangles.size(), 0), left_(kStepsEach * triangles.size() + kStepsAtLeast) {
    glm::dvec2 low(std::numeric_limits<double>::infinity()), high(-std::numeric_limits<double>::infinity());
    for (const auto& t : triangles)
      for (const auto& p : t) {
        low = glm::min(low, p);
        high = glm::max(high, p);
      }
    low_ = low;
    const glm::dvec2 extent = glm::max(high - low, glm::dvec2(1e-300));
    const double cell = std::sqrt(extent.x * extent.y / static_cast<double>(triangles.size()));
    for (int axis = 0; axis < 2; ++axis) {
      const double wanted = cell > 0.0 ? extent[axis] / cell : 1.0;
      count_[axis] = static_cast<int>(std::clamp(wanted, 1.0, 4096.0));
      inverse_[axis] = count_[axis] / extent[axis];
    }
    cells_.resize(static_cast<std::size_t>(count_[0]) * static_cast<std::size_t>(count_[1]));
  }

  /// Puts triangle `t` into the first layer where it meets nothing; once too much was looked at, into one of its own.
  void insert(std::uint32_t t) {
    std::vector<bool> blocked;
    forCells(triangles_[t], [&](std::vector<std::uint32_t>& cell) {
      if (!spend(2 * (1 + cell.size()))) return;  // the triangle is put there, too
      for (const std::uint32_t other : cell) {
        if (layer_[other] < blocked.size() && blocked[layer_[other]]) continue;
        if (!overlaps(triangles_[t], triangles_[other])) continue;
        if (blocked.size() <= layer_[other]) blocked.resize(layer_[other] + 1, false);
        blocked[layer_[other]] = true;
      }
    });
    if (left_ == 0) {
      layer_[t] = layer_count_++;
      return;
    }
    layer_[t] = static_cast<std::uint32_t>(std::find(blocked.begin(), blocked.end(), false) - blocked.begin());
    layer_count_ = std::max(layer_count_, layer_[t] + 1);
    forCells(triangles_[t], [&](std::vector<std::uint32_t>& cell) { cell.push_back(t); });
  }

  [[nodiscard]] const std::vector<std::uint32_t>& layers() const { return layer_; }

 private:
  /// So many steps a triangle, and some whatever their number is. Most triangles take ten or so; discs of thousands
  /// that meet in one corner, and slivers across the plane, would take the square of their number.
  static constexpr std::size_t kStepsEach = 128, kStepsAtLeast = std::size_t{1} << 22U;
  [[nodiscard]] bool spend(std::size_t steps) {
    left_ -= std::min(left_, steps);
    return left_ > 0;
  }
  [[nodiscard]] int cellOf(double value, int axis) const {
    return std::clamp(static_cast<int>((value - low_[axis]) * inverse_[axis]), 0, count_[axis] - 1);
  }
  template <typename Function>
  void forCells(const Triangle2& t, const Function& function) {
    const glm::dvec2 low = glm::min(glm::min(t[0], t[1]), t[2]);
    const glm::dvec2 high = glm::max(glm::max(t[0], t[1]), t[2]);
    for (int y = cellOf(low.y, 1); y <= cellOf(high.y, 1) && left_ > 0; ++y)
      for (int x = cellOf(low.x, 0); x <= cellOf(high.x, 0); ++x)
        function(
            cells_[static_cast<std::size_t>(y) * static_cast<std::size_t>(count_[0]) + static_cast<std::size_t>(x)]);
  }

  const std::vector<Triangle2>& triangles_;
  std::vector<std::uint32_t> layer_;
  std::uint32_t layer_count_ = 0;
  std::size_t left_;  ///< steps that may still be taken
  glm::dvec2 low_{0.0};
  std::array<int, 2> count_{1, 1};
  std::array<double, 2> inverse_{1.0, 1.0};
  std::vector<std::vector<std::uint32_t>> cells_;
};

}  // namespace

std::vector<std::uint32_t> overlapLayers(const std::vector<Triangle2>& triangles) {
  if (triangles.size() < 2) return std::vector<std::uint32_t>(triangles.size(), 0);
  OverlapGrid grid(triangles);
  for (std::uint32_t t = 0; t < triangles.size(); ++t) grid.insert(t);
  return grid.layers();
}

bool overlapFree(const std::vector<Triangle2>& triangles) {
  const std::vector<std::uint32_t> layers = overlapLayers(triangles);
  return std::ranges::all_of(layers, [](std::uint32_t layer) { return layer == 0; });
}

glm::dvec2 rectangleSides(const FlatScene& flat, const std::vector<std::uint32_t>& triangles,
                          const glm::dvec3& normal) {
  const Rectangle rectangle = smallestRectangle(cornerPoints(project(flat, triangles, planeFrame(normal))));
  return {std::max(rectangle.size.x, rectangle.size.y), std::min(rectangle.size.x, rectangle.size.y)};
}

std::vector<Chart> fitCharts(const FlatScene& flat, const Facets& facets,
                             const std::vector<std::vector<std::uint32_t>>& groups) {
  std::vector<Chart> charts;
  for (const auto& group : groups) {
    interruptionPoint();
    std::vector<std::uint32_t> triangles;
    for (const std::uint32_t f : group)
      triangles.insert(triangles.end(), facets.facets[f].triangles.begin(), facets.facets[f].triangles.end());
    fitGroup(flat, std::move(triangles), group.size() == 1, charts);
  }
  std::ranges::stable_sort(charts, [](const Chart& a, const Chart& b) {
    return a.instance != b.instance ? a.instance < b.instance : a.triangles.front() < b.triangles.front();
  });
  return charts;
}

}  // namespace radiosity::scene
