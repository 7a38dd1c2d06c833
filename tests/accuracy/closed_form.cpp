#include "tests/accuracy/closed_form.h"

#include <array>
#include <cstddef>
#include <glm/geometric.hpp>
#include <map>
#include <numeric>
#include <utility>
#include <vector>

namespace radiosity::accuracy {
namespace {

using Position = std::array<double, 3>;

/// Whether every edge belongs to two triangles, once in either direction, and all hang together.
bool closedAndConnected(const std::vector<oracle::Triangle>& triangles) {
  std::map<std::pair<Position, Position>, std::size_t> edges;
  const auto position = [](const glm::dvec3& p) { return Position{p.x, p.y, p.z}; };
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& corners = triangles[t].corners;
      if (!edges.emplace(std::pair(position(corners[k]), position(corners[(k + 1) % 3])), t).second) return false;
    }
  }
  std::vector<std::size_t> group(triangles.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  const auto root = [&group](std::size_t t) {
    while (group[t] != t) t = group[t] = group[group[t]];
    return t;
  };
  for (const auto& [edge, triangle] : edges) {
    const auto twin = edges.find({edge.second, edge.first});
    if (twin == edges.end()) return false;
    group[root(triangle)] = root(twin->second);
  }
  for (std::size_t t = 1; t < triangles.size(); ++t) {
    if (root(t) != root(0)) return false;
  }
  return true;
}

}  // namespace

std::optional<glm::dvec3> cavityIrradiance(const oracle::TriangleScene& scene) {
  if (scene.triangles.empty() || !scene.lamps.empty() || !scene.textures.empty()) return {};
  const auto& first = scene.triangles.front();
  double volume = 0.0;  // negative: the front is inside
  for (const auto& triangle : scene.triangles) {
    if (triangle.reflectance != first.reflectance || triangle.emission_lux != first.emission_lux ||
        triangle.double_sided || triangle.see_through) {
      return {};
    }
    const auto& [a, b, c] = triangle.corners;
    volume += glm::dot(a - first.corners[0], glm::cross(b - first.corners[0], c - first.corners[0]));
  }
  if (!(volume < 0.0) || !closedAndConnected(scene.triangles)) return {};
  return first.emission_lux / (1.0 - first.reflectance);
}

}  // namespace radiosity::accuracy
