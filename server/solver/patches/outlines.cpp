#include "server/solver/patches/outlines.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

namespace radiosity::solver {
namespace {

double cross(const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; }

/// Andrew's monotone chain; counter-clockwise, collinear points left out.
std::vector<glm::dvec2> convexHull(std::vector<glm::dvec2> points) {
  const auto before = [](const glm::dvec2& a, const glm::dvec2& b) { return a.x != b.x ? a.x < b.x : a.y < b.y; };
  std::sort(points.begin(), points.end(), before);
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return {};
  std::vector<glm::dvec2> hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t base = hull.size();
    for (const auto& p : points) {
      while (hull.size() >= base + 2 && cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 1e-9)
        hull.pop_back();
      hull.push_back(p);
    }
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  return hull;
}

/// Sutherland and Hodgman: the part of `polygon` to the left of the line from a to b.
TexelPolygon cut(const TexelPolygon& polygon, const glm::dvec2& a, const glm::dvec2& b) {
  TexelPolygon left;
  for (std::uint32_t i = 0; i < polygon.count; ++i) {
    const glm::dvec2 p = polygon.corner[i], q = polygon.corner[(i + 1) % polygon.count];
    const double at_p = cross(b - a, p - a), at_q = cross(b - a, q - a);
    if (at_p >= 0.0 && left.count < 8) left.corner[left.count++] = p;
    if (((at_p < 0.0 && at_q > 0.0) || (at_p > 0.0 && at_q < 0.0)) && left.count < 8)
      left.corner[left.count++] = p + (q - p) * (at_p / (at_p - at_q));
  }
  if (left.count < 3) left.count = 0;
  return left;
}

}  // namespace

double TexelPolygon::area() const {
  double sum = 0.0;
  for (std::uint32_t i = 2; i < count; ++i) sum += 0.5 * cross(corner[i - 1] - corner[0], corner[i] - corner[0]);
  return sum;
}

glm::dvec2 TexelPolygon::point(double u, double v) const {
  if (count == 4) {  // a parallelogram, as nearly all are, keeps the full stratification
    const glm::dvec2 e = corner[1] - corner[0], f = corner[3] - corner[0], rest = corner[2] - corner[0] - e - f;
    if (std::abs(rest.x) + std::abs(rest.y) < 1e-9) return corner[0] + u * e + v * f;
  }
  double wanted = u * area();
  for (std::uint32_t i = 2; i < count; ++i) {
    const double part = 0.5 * cross(corner[i - 1] - corner[0], corner[i] - corner[0]);
    if (wanted < part || i + 1 == count) {
      const double root = std::sqrt(std::clamp(part > 0.0 ? wanted / part : 0.0, 0.0, 1.0));
      return (1.0 - root) * corner[0] + root * ((1.0 - v) * corner[i - 1] + v * corner[i]);
    }
    wanted -= part;
  }
  return corner[0];
}

Outlines::Outline Outlines::of(const scene::PatchScene& patches, const scene::Surface& surface) {
  std::vector<glm::dvec2> corners;
  for (std::uint32_t t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t) {
    for (std::uint32_t k = 0; k < 3; ++k) corners.emplace_back(patches.vertices[patches.indices[3 * t + k]].texel);
  }
  const auto hull = convexHull(std::move(corners));
  Outline outline;
  if (hull.size() < 3 || hull.size() > 4) return outline;
  outline.count = static_cast<std::uint32_t>(hull.size());
  std::copy(hull.begin(), hull.end(), outline.corner.begin());
  return outline;
}

Outlines::Outlines(const scene::PatchScene& patches) : patches_(patches) {
  outline_.reserve(patches.surfaces.size());
  for (const auto& surface : patches.surfaces) {
    outline_.push_back(surface.planar ? of(patches, surface) : Outline{});
  }
}

TexelPolygon Outlines::node(std::uint32_t surface, std::uint32_t level, std::uint32_t x, std::uint32_t y) const {
  const auto& s = patches_.surfaces[surface];
  const glm::dvec2 low(x << level, y << level);
  const glm::dvec2 high(std::min((x + 1) << level, s.width), std::min((y + 1) << level, s.height));
  TexelPolygon polygon;
  polygon.count = 4;
  polygon.corner[0] = low;
  polygon.corner[1] = {high.x, low.y};
  polygon.corner[2] = high;
  polygon.corner[3] = {low.x, high.y};
  const auto& outline = outline_[surface];
  for (std::uint32_t i = 0; i < outline.count && polygon.count > 0; ++i) {
    polygon = cut(polygon, outline.corner[i], outline.corner[(i + 1) % outline.count]);
  }
  return polygon;
}

}  // namespace radiosity::solver
