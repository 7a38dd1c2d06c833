#include "server/solver/surface/tinted_rays.h"

#include <array>
#include <glm/geometric.hpp>

#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Ways to a point on a face end so far before it (unit box), well above the rounding of positions.
constexpr double kBeforeFace = 2e-6;
/// What a way in single precision is sent to is known to so much, times what the cosine there makes of it.
constexpr double kNearPoint = 1e-5;

}  // namespace

std::uint32_t TintedRays::see(const LeafRays::Place& from, const glm::dvec3& direction, std::uint64_t key,
                              LeafRays::Place& end, glm::dvec3& tint, const geometry::Hit* first) const {
  if (!rays_->hasTints()) return rays_->see(from, direction, key, end, first);
  LeafRays::Panes panes;
  const auto value = rays_->see(from, direction, key, end, first, &panes);
  tint *= panes.tint;
  return value;
}

glm::dvec3 TintedRays::passageTo(const LeafRays::Place& from, const glm::dvec3& to, const glm::dvec3& normal,
                                 std::uint64_t key) const {
  constexpr glm::dvec3 kHidden(0.0);
  if (rays_->isOpaque()) return rays_->isOpen(from, to, normal) ? glm::dvec3(1.0) : kHidden;
  const auto way = to - from.position;
  const double length = glm::length(way);
  if (!(length > kNearPoint)) return kHidden;
  LeafRays::Place end;
  glm::dvec3 tint(1.0);
  const auto value = see(from, way / length, key, end, tint);
  if (LeafRays::isSky(value)) return tint;
  const double leaves = normal == glm::dvec3(0.0) ? 1.0 : -glm::dot(normal, way) / length;
  const bool is_there = leaves > 0.0 && leaves * (length - glm::distance(end.position, from.position)) <= kNearPoint;
  return is_there ? tint : kHidden;
}

void TintedRays::passageTo(const LeafRays::Place& from, std::span<const glm::dvec3> points, const glm::dvec3& normal,
                           std::uint64_t key, std::span<glm::dvec3> passing) const {
  if (!rays_->isOpaque()) {
    for (std::size_t k = 0; k < points.size(); ++k) passing[k] = passageTo(from, points[k], normal, mixKeys(key, k));
    return;
  }
  LeafRays::Points ends;
  for (const auto& point : points) {
    const glm::vec3 end(point + kBeforeFace * normal);
    ends.x.push_back(end.x);
    ends.y.push_back(end.y);
    ends.z.push_back(end.z);
  }
  std::array<std::int32_t, kMostPoints> hidden;
  rays_->hide(LeafRays::startOf(from), ends, hidden.data());
  for (std::size_t k = 0; k < points.size(); ++k) passing[k] = glm::dvec3(hidden[k] == 0 ? 1.0 : 0.0);
}

}  // namespace radiosity::solver
