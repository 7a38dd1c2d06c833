#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>

#include "common/union_find.h"
#include "server/scene/charts/charts.h"

namespace radiosity::scene {
namespace {

using Triangle2 = std::array<glm::dvec2, 3>;

constexpr double kRangeSlack = 1e-4;     // exporters round
constexpr double kDensityFactor = 64.0;  // a triangle's texel density against the instance's
constexpr double kNoUvArea = 1e-9;       // area ratio below which a triangle's map cannot be inverted
constexpr double kMaxOddShare = 0.01;
constexpr double kSameUv = 1e-6;

Triangle2 cornersOf(const Primitive& primitive, const FlatTriangle& triangle) {
  Triangle2 corners;
  for (std::size_t i = 0; i < 3; ++i)
    corners[i] = glm::dvec2(
        primitive.texcoord1[primitive.indices[std::size_t{3} * triangle.source + triangle.source_corner[i]]]);
  return corners;
}

double areaOf(const Triangle2& t) {
  const glm::dvec2 a = t[1] - t[0], b = t[2] - t[0];
  return 0.5 * (a.x * b.y - a.y * b.x);
}

std::string rangeFault(const Triangle2& corners, std::uint32_t source) {
  for (const auto& uv : corners) {
    if (!std::isfinite(uv.x) || !std::isfinite(uv.y))
      return fmt::format("triangle {} has a value that is no number", source);
    if (uv.x < -kRangeSlack || uv.y < -kRangeSlack || uv.x > 1.0 + kRangeSlack || uv.y > 1.0 + kRangeSlack)
      return fmt::format("triangle {} lies outside [0, 1] at ({:.4g}, {:.4g})", source, uv.x, uv.y);
  }
  return {};
}

/// One affine map explains every corner: then the island is flat and evenly stretched.
bool isOneMap(const FlatScene& flat, const Chart& chart) {
  std::size_t largest = 0;
  for (std::size_t i = 1; i < chart.triangles.size(); ++i)
    if (std::abs(areaOf(chart.corners[i])) > std::abs(areaOf(chart.corners[largest]))) largest = i;
  const Triangle2& t = chart.corners[largest];
  const FlatTriangle& triangle = flat.triangles[chart.triangles[largest]];
  const glm::dmat2 inverse = glm::inverse(glm::dmat2(t[1] - t[0], t[2] - t[0]));
  const glm::dvec3 p0 = flat.points[triangle.points[0]];
  const glm::dvec3 e1 = flat.points[triangle.points[1]] - p0, e2 = flat.points[triangle.points[2]] - p0;
  const double bound = 2e-5 * std::sqrt(chart.area);
  for (std::size_t i = 0; i < chart.triangles.size(); ++i)
    for (std::size_t c = 0; c < 3; ++c) {
      const glm::dvec2 w = inverse * (chart.corners[i][c] - t[0]);
      const glm::dvec3 p = flat.points[flat.triangles[chart.triangles[i]].points[c]];
      if (glm::distance(p, p0 + e1 * w.x + e2 * w.y) > bound) return false;
    }
  return true;
}

}  // namespace

std::string lightmapUvFault(const Scene& scene, const FlatScene& flat, std::uint32_t instance) {
  const Primitive& primitive = scene.primitives[scene.instances[instance].primitive];
  if (primitive.texcoord1.size() != primitive.positions.size()) return "its length is not that of POSITION";
  std::vector<Triangle2> corners;
  double area = 0.0, uv_area = 0.0;
  for (std::uint32_t t = flat.first_triangle[instance]; t < flat.first_triangle[instance + 1]; ++t) {
    corners.push_back(cornersOf(primitive, flat.triangles[t]));
    if (std::string fault = rangeFault(corners.back(), flat.triangles[t].source); !fault.empty()) return fault;
    area += flat.triangles[t].area;
    uv_area += std::abs(areaOf(corners.back()));
  }
  if (!(uv_area > 1e-9)) return "it has no area";
  const double density = uv_area / area;
  double odd_area = 0.0;  // a few odd triangles are an exporter's rounding
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const FlatTriangle& triangle = flat.triangles[flat.first_triangle[instance] + i];
    const double ratio = std::abs(areaOf(corners[i])) / (triangle.area * density);
    const bool odd = ratio < 1.0 / (kDensityFactor * kDensityFactor) || ratio > kDensityFactor * kDensityFactor;
    if (odd) odd_area += triangle.area;
    if (ratio < kNoUvArea || odd_area > kMaxOddShare * area)
      return fmt::format("triangle {} has {:.3g} times the mean texel density", triangle.source, std::sqrt(ratio));
  }
  if (!overlapFree(corners)) return "triangles overlap in it";
  return {};
}

std::vector<Chart> uvCharts(const Scene& scene, const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
                            std::uint32_t instance) {
  const Primitive& primitive = scene.primitives[scene.instances[instance].primitive];
  const std::uint32_t first = flat.first_triangle[instance], end = flat.first_triangle[instance + 1];
  std::vector<Triangle2> corners;
  for (std::uint32_t t = first; t < end; ++t) corners.push_back(cornersOf(primitive, flat.triangles[t]));
  const auto uvAt = [&](std::uint32_t t, std::uint32_t point) {
    for (std::size_t c = 0; c < 3; ++c)
      if (flat.triangles[t].points[c] == point) return corners[t - first][c];
    return glm::dvec2(-1.0);
  };
  UnionFind islands(end - first);
  for (std::uint32_t t = first; t < end; ++t)
    for (std::size_t e = 0; e < 3; ++e) {
      const std::uint32_t other = neighbours[std::size_t{3} * t + e];
      if (other == kNone || areaOf(corners[t - first]) * areaOf(corners[other - first]) < 0.0) continue;
      const std::uint32_t a = flat.triangles[t].points[e], b = flat.triangles[t].points[(e + 1) % 3];
      if (glm::distance(uvAt(t, a), uvAt(other, a)) <= kSameUv && glm::distance(uvAt(t, b), uvAt(other, b)) <= kSameUv)
        islands.join(t - first, other - first);
    }
  std::vector<Chart> charts;
  std::vector<std::uint32_t> chart_of(end - first, kNone);
  for (std::uint32_t t = first; t < end; ++t) {
    std::uint32_t& slot = chart_of[islands.find(t - first)];
    if (slot == kNone) {
      slot = static_cast<std::uint32_t>(charts.size());
      charts.push_back({});
      charts.back().instance = instance;
      charts.back().from_file = true;
    }
    Chart& chart = charts[slot];
    chart.triangles.push_back(t);
    chart.corners.push_back(corners[t - first]);
    chart.area += flat.triangles[t].area;
  }
  for (Chart& chart : charts) chart.planar = isOneMap(flat, chart);
  return charts;
}

void shareDetailOfLayouts(std::vector<Chart>& charts) {
  for (std::size_t first = 0, end = 0; first < charts.size(); first = end) {
    double texels = 0.0, area = 0.0;
    for (; end < charts.size() && charts[end].instance == charts[first].instance; ++end) {
      if (!charts[end].from_file) continue;
      texels += charts[end].area * charts[end].detail * charts[end].detail;
      area += charts[end].area;
    }
    const double shared = area > 0.0 ? std::max(1.0, std::sqrt(texels / area)) : 1.0;
    for (auto c = first; c < end; ++c)
      if (charts[c].from_file) charts[c].detail = shared;
  }
}

}  // namespace radiosity::scene
