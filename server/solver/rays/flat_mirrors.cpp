#include "server/solver/rays/flat_mirrors.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <optional>
#include <utility>

namespace radiosity::solver {
namespace {

/// Normals and places of one plane differ by no more, beside the rounding of corners: an image at the far end of the
/// unit box is off by as much.
constexpr double kSamePlane = 2e-6;

/// Of the area of all surfaces, mirrors in one plane reflect as much as this at least: what comes from less is not
/// worth looking for from everywhere. A seat of glass in a room is as much, the edge of a table top less. With 1e-3
/// that room takes 14 s to 3 %, with this 5.4, with 3e-5 6.9.
constexpr double kLeastPart = 1e-4;

/// Of models of thousands of small flat mirrors no more planes are told apart, those of the largest.
constexpr std::size_t kMostPlanes = 256;

bool isSharp(const SpecularLeaves& mirrors, std::uint32_t value) {
  return mirrors.has(value) && mirrors.roughness(value) <= static_cast<double>(FlatMirrors::kSharp);
}

/// Of light from all around, the part that the sharp leaves of a side reflect: their area, times that.
double reflectedArea(const scene::PatchScene& patches, const SpecularLeaves& mirrors, const Side& side) {
  double sum = 0.0;
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto value = side.first_value + leaf;
    if (!isSharp(mirrors, value)) continue;
    const auto reflects = mirrors.meanReflectance(value);  // of glass as a part of what its area stops
    sum +=
        static_cast<double>(patches.node_area[side.first_node + leaf] * std::max({reflects.x, reflects.y, reflects.z}));
  }
  return sum;
}

/// Under the triangles of a surface: the mean of their planes. Nothing: they lie in none.
std::optional<FlatMirrors::Plane> planeUnder(const scene::PatchScene& patches, const scene::Surface& surface) {
  if (!surface.planar) return std::nullopt;
  std::vector<glm::dvec3> corners;
  glm::dvec3 normal(0.0), sum(0.0);
  for (auto i = 3 * surface.first_triangle; i < 3 * (surface.first_triangle + surface.triangle_count); ++i) {
    corners.emplace_back(patches.vertices[patches.indices[i]].position);
    sum += corners.back();
    if (corners.size() % 3 != 0) continue;
    const auto* last = &corners.back();
    normal += glm::cross(last[-1] - last[-2], last[0] - last[-2]);
  }
  FlatMirrors::Plane plane;
  if (!(glm::length(normal) > 0.0)) return std::nullopt;
  plane.normal = glm::normalize(normal);
  plane.distance = glm::dot(plane.normal, sum) / static_cast<double>(corners.size());
  plane.low = plane.high = corners.front();
  for (const auto& corner : corners) {
    if (std::abs(plane.heightOf(corner)) > kSamePlane) return std::nullopt;
    plane.low = glm::min(plane.low, corner);
    plane.high = glm::max(plane.high, corner);
  }
  return plane;
}

/// Either may look the other way. All of the latter lies in the plane of the former.
bool isSame(const FlatMirrors::Plane& a, const FlatMirrors::Plane& b) {
  const double sign = glm::dot(a.normal, b.normal) < 0.0 ? -1.0 : 1.0;
  const auto middle = 0.5 * (b.low + b.high), in_plane = middle - b.heightOf(middle) * b.normal;
  const double reach = 0.5 * glm::distance(b.low, b.high);
  return std::abs(a.heightOf(in_plane)) + reach * glm::length(a.normal - sign * b.normal) <= kSamePlane;
}

}  // namespace

double FlatMirrors::Plane::heightOf(const glm::dvec3& point) const { return glm::dot(normal, point) - distance; }

glm::dvec3 FlatMirrors::Plane::mirrored(const glm::dvec3& point) const {
  return point - 2.0 * heightOf(point) * normal;
}

glm::dvec3 FlatMirrors::Plane::mirroredWay(const glm::dvec3& way) const {
  return way - 2.0 * glm::dot(normal, way) * normal;
}

std::shared_ptr<const FlatMirrors> FlatMirrors::find(const scene::PatchScene& patches, const std::vector<Side>& sides,
                                                     const SpecularLeaves& mirrors, std::size_t most) {
  std::vector<Plane> planes;
  std::vector<std::size_t> of_side(sides.size(), std::numeric_limits<std::size_t>::max());
  std::size_t leaves = 0;
  double area = 0.0;
  std::vector<std::pair<double, const Side*>> sharp;
  for (const auto& side : sides) {
    leaves += side.leaf_count;
    area += static_cast<double>(patches.node_area[side.first_node + side.node_count - 1]);
    const double reflected = reflectedArea(patches, mirrors, side);
    if (reflected > 0.0) sharp.emplace_back(reflected, &side);
  }
  std::ranges::stable_sort(sharp, std::ranges::greater{}, [](const auto& one) { return one.first; });
  for (const auto& [reflected, side] : sharp) {
    const auto plane = planeUnder(patches, patches.surfaces[side->surface]);
    if (!plane) continue;
    const auto known = std::ranges::find_if(planes, [&](const Plane& other) { return isSame(other, *plane); });
    if (known == planes.end() && planes.size() == kMostPlanes) continue;
    auto& of = known == planes.end() ? planes.emplace_back(*plane) : *known;
    of_side[side->number] = static_cast<std::size_t>(&of - planes.data());
    of.low = glm::min(of.low, plane->low);
    of.high = glm::max(of.high, plane->high);
    of.area += reflected;
  }
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < planes.size(); ++i)
    if (planes[i].area >= kLeastPart * area) order.push_back(i);
  if (order.empty() || most == 0) return nullptr;
  std::ranges::stable_sort(order, std::ranges::greater{}, [&](std::size_t i) { return planes[i].area; });
  order.resize(std::min({order.size(), most, std::size_t{kNoPlane}}));
  const std::shared_ptr<FlatMirrors> found(new FlatMirrors());
  std::vector<std::uint8_t> number(planes.size(), kNoPlane);
  for (const auto i : order) {
    number[i] = static_cast<std::uint8_t>(found->planes_.size());
    found->planes_.push_back(planes[i]);
  }
  found->plane_of_.assign(leaves, kNoPlane);
  for (const auto& side : sides) {
    if (of_side[side.number] >= planes.size()) continue;
    for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value)
      if (isSharp(mirrors, value)) found->plane_of_[value] = number[of_side[side.number]];
  }
  return found;
}

}  // namespace radiosity::solver
