#include "server/solver/rays/flat_mirrors.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <span>

namespace radiosity::solver {
namespace {

/// Normals and places of one plane differ by no more, beside the rounding of corners: an image at the far end of the
/// unit box is off by as much.
constexpr double kSame = 2e-6;

/// Of the area of all surfaces, mirrors in one plane reflect as much as this at least: what comes from less is not
/// worth looking for from everywhere. A table of glass is three times that, its edges a tenth.
constexpr double kLeastPart = 1e-3;

bool isSharp(const SpecularLeaves& mirrors, std::uint32_t value) {
  return mirrors.has(value) && mirrors.roughness(value) <= static_cast<double>(FlatMirrors::kSharp);
}

/// The first leaf of a side that reflects sharply, or kNone.
std::uint32_t firstSharp(const SpecularLeaves& mirrors, const Side& side) {
  for (auto value = side.first_value; value < side.first_value + side.leaf_count; ++value)
    if (isSharp(mirrors, value)) return value;
  return scene::kNone;
}

/// Of a surface; area 0: it is not flat.
FlatMirrors::Plane planeUnder(const scene::PatchScene& patches, const scene::Surface& surface) {
  FlatMirrors::Plane plane;
  if (!surface.planar) return plane;
  const auto frames = std::span(patches.triangles).subspan(surface.first_triangle, surface.triangle_count);
  plane.normal = glm::normalize(glm::dvec3(frames.front().normal));
  plane.distance = glm::dot(plane.normal, glm::dvec3(frames.front().origin));
  plane.low = glm::dvec3(HUGE_VAL);
  plane.high = glm::dvec3(-HUGE_VAL);
  for (std::uint32_t k = 0; k < surface.triangle_count; ++k) {
    glm::dvec3 corner[3];
    for (std::uint32_t i = 0; i < 3; ++i) {
      corner[i] = glm::dvec3(patches.vertices[patches.indices[3 * (surface.first_triangle + k) + i]].position);
      if (std::abs(plane.heightOf(corner[i])) > kSame) return {};
      plane.low = glm::min(plane.low, corner[i]);
      plane.high = glm::max(plane.high, corner[i]);
    }
    plane.area += 0.5 * glm::length(glm::cross(corner[1] - corner[0], corner[2] - corner[0]));
  }
  return plane;
}

/// Either may look the other way.
bool isSame(const FlatMirrors::Plane& a, const FlatMirrors::Plane& b) {
  const double sign = glm::dot(a.normal, b.normal) < 0.0 ? -1.0 : 1.0;
  return glm::length(a.normal - sign * b.normal) <= kSame && std::abs(a.distance - sign * b.distance) <= kSame;
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
  for (const auto& side : sides) {
    leaves += side.leaf_count;
    area += static_cast<double>(patches.node_area[side.first_node + side.node_count - 1]);
    const auto sharp = firstSharp(mirrors, side);
    if (sharp == scene::kNone) continue;
    auto plane = planeUnder(patches, patches.surfaces[side.surface]);
    if (!(plane.area > 0.0)) continue;
    const auto reflects = mirrors.meanReflectance(sharp);
    plane.area *= static_cast<double>(std::max({reflects.x, reflects.y, reflects.z}));
    const auto known = std::ranges::find_if(planes, [&](const Plane& other) { return isSame(plane, other); });
    of_side[side.number] = static_cast<std::size_t>(known - planes.begin());
    if (known == planes.end()) {
      planes.push_back(plane);
      continue;
    }
    known->low = glm::min(known->low, plane.low);
    known->high = glm::max(known->high, plane.high);
    known->area += plane.area;
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
