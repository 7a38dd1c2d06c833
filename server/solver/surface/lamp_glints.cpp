#include "server/solver/surface/lamp_glints.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "server/solver/math/microfacets.h"
#include "server/solver/math/sampling.h"
#include "server/solver/patches/unshot_pyramid.h"

namespace radiosity::solver {
namespace {

/// In smoother metal a lamp is seen as in a mirror, and looks at its points find it no better.
constexpr double kLeastRoughness = 0.1;
/// A point of a lamp nearer to the plane of the metal, or whose own plane is nearer to it, than this brings nothing
/// (unit box).
constexpr double kInPlane = 1e-6;
constexpr std::uint64_t kGlintKey = 0x474C494E54ULL;

double strengthOf(const glm::vec3& emission) { return static_cast<double>(channelSum(emission)); }

}  // namespace

LampGlints::LampGlints(std::vector<LightPolygon> lamps) : lamps_(std::move(lamps)) {
  double all = 0.0;
  for (const auto& lamp : lamps_) up_to_.push_back(all += lamp.area * strengthOf(lamp.emission));
  if (!(all > 0.0)) lamps_.clear();
}

bool LampGlints::isRough(const SpecularLeaves& mirrors, std::uint32_t value) {
  return mirrors.has(value) && mirrors.roughness(value) >= kLeastRoughness;
}

/// Of looks that find this point of a lamp, by solid angle: points are drawn by power. `way`: there.
double LampGlints::density(const glm::vec3& emission, const glm::dvec3& normal, const glm::dvec3& way) const {
  const double square = glm::dot(way, way), leaves = -glm::dot(normal, way);
  if (lamps_.empty() || leaves <= kInPlane) return 0.0;
  return strengthOf(emission) / up_to_.back() * square * std::sqrt(square) / leaves;
}

glm::dvec3 LampGlints::look(const TintedRays& rays, const SpecularLeaves& mirrors, const RayEnd& at) const {
  if (lamps_.empty() || LeafRays::isSky(at.value) || at.value == LeafRays::kNothing || !isRough(mirrors, at.value))
    return glm::dvec3(0.0);
  const auto key = mixKeys(at.key, kGlintKey);
  const auto draw = sobol4(0, key);
  const auto found = std::ranges::upper_bound(up_to_, draw.x * up_to_.back());
  const auto& lamp = lamps_[std::min(static_cast<std::size_t>(found - up_to_.begin()), lamps_.size() - 1)];
  const glm::dvec3 point(lamp.point(draw.y, draw.z)), normal(lamp.normal), way = point - at.end.position;
  const double by_looks = density(lamp.emission, normal, way);
  if (by_looks <= 0.0 || glm::dot(at.end.normal, way) <= kInPlane) return glm::dvec3(0.0);
  const auto once = bounceOnce(at.end.normal, at.direction, glm::normalize(way), mirrors.roughness(at.value));
  if (once.density <= 0.0) return glm::dvec3(0.0);
  const auto passes = rays.passageTo(at.end, point, normal, key);
  return passes * glm::dvec3(mirrors.reflectance(at.value, static_cast<float>(once.edge))) *
         (once.density / (once.density + by_looks)) * glm::dvec3(lamp.emission);
}

double LampGlints::weightOf(const SpecularLeaves& mirrors, const RayEnd& metal, const RayEnd& lamp,
                            const glm::vec3& emission) const {
  if (lamps_.empty() || !isRough(mirrors, metal.value)) return 1.0;
  const double by_looks = density(emission, lamp.end.normal, lamp.end.position - metal.end.position);
  const auto once = bounceOnce(metal.end.normal, metal.direction, lamp.direction, mirrors.roughness(metal.value));
  return once.density > 0.0 ? once.density / (once.density + by_looks) : 1.0;
}

}  // namespace radiosity::solver
