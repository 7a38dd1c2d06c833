#include "server/solver/edits/change_reach.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Places on what is gone, on what came, and on what was altered; so many turns share them.
constexpr std::size_t kPlaces = 96;
constexpr std::uint32_t kTurns = 12;
/// Of a leaf that stays, but of which more or less is left, the link changes by about this part.
constexpr double kAltered = 0.5;
/// Rays begin so far from where they start (unit box), and what is nearer than a place by so much of the way hides it.
constexpr double kLift = 1e-5, kHides = 1e-4;
/// Farther than the unit box is wide.
constexpr double kFar = 4.0;

/// Of all triangles, numbered as the scene's.
std::shared_ptr<const scene::Bvh> treeOf(const scene::PatchScene& patches) {
  std::vector<scene::Bvh::Triangle> triangles(patches.triangles.size());
  for (std::size_t i = 0; i < patches.indices.size(); ++i)
    triangles[i / 3][i % 3] = patches.vertices[patches.indices[i]].position;
  return std::make_shared<const scene::Bvh>(std::move(triangles));
}

/// Of a place that a small shooter of radiosity one sees at this distance, both cosines included.
double irradiance(double area, double cosines, double distance) {
  return std::min(1.0, area * cosines / (std::numbers::pi * distance * distance));
}

}  // namespace

ChangeReach::ChangeReach(const scene::PatchScene& before, const scene::PatchScene& after, const scene::PatchMap& map)
    : before_(before), after_(after), tree_before_(treeOf(before)), tree_after_(treeOf(after)) {
  std::vector<bool> gone(before.surfaces.size(), true);
  for (std::size_t s = 0; s < after.surfaces.size(); ++s) {
    if (!map.moved[s]) gone[map.surface_before[s]] = false;
  }
  addTriangles(before, gone, gone_);
  addTriangles(after, map.moved, come_);
  addAltered(after, map);
}

/// Places evenly over the area of the surfaces that are marked.
void ChangeReach::addTriangles(const scene::PatchScene& patches, const std::vector<bool>& marked,
                               Places& places) const {
  const auto corners = [&](std::uint32_t t) {
    std::array<glm::dvec3, 3> corner;
    for (std::size_t c = 0; c < 3; ++c)
      corner[c] = glm::dvec3(patches.vertices[patches.indices[std::size_t{3} * t + c]].position);
    return corner;
  };
  std::vector<std::pair<std::uint32_t, double>> area_until;
  double all = 0.0;
  for (std::uint32_t t = 0; t < patches.triangles.size(); ++t) {
    if (!marked[patches.triangle_surface[t]]) continue;
    const auto [a, b, c] = corners(t);
    all += 0.5 * glm::length(glm::cross(b - a, c - a));
    area_until.push_back({t, all});
  }
  for (std::size_t i = 0, next = 0; all > 0.0 && i < kPlaces; ++i) {
    const double at = (static_cast<double>(i) + 0.5) / kPlaces * all;
    while (next + 1 < area_until.size() && area_until[next].second <= at) ++next;
    const auto triangle = area_until[next].first;
    const auto [a, b, c] = corners(triangle);
    const glm::dvec4 random = sobol4(static_cast<std::uint32_t>(i), 0);
    const double u = std::sqrt(random.x);
    places.push_back({a + u * (1.0 - random.y) * (b - a) + u * random.y * (c - a),
                      glm::dvec3(patches.triangles[triangle].normal), all / kPlaces});
  }
}

/// Leaves of what has not moved of which more or less is left than was.
void ChangeReach::addAltered(const scene::PatchScene& patches, const scene::PatchMap& map) {
  Places all;
  for (std::uint32_t s = 0; s < patches.surfaces.size(); ++s) {
    const auto& surface = patches.surfaces[s];
    if (map.moved[s]) continue;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      const auto& point = patches.leaves[surface.first_leaf + leaf];
      if (!map.leaf_altered[surface.first_leaf + leaf] || point.triangle == scene::kNone) continue;
      const auto& frame = patches.triangles[point.triangle];
      const float x = static_cast<float>(leaf % surface.width) + 0.5F,
                  y = static_cast<float>(leaf / surface.width) + 0.5F;
      all.push_back({glm::dvec3(frame.origin + x * frame.du + y * frame.dv), glm::dvec3(frame.normal),
                     kAltered * kAltered * static_cast<double>(surface.texel_area)});
    }
  }
  const std::size_t count = std::min(all.size(), kPlaces);
  for (std::size_t i = 0; i < count; ++i) {
    altered_.push_back(all[i * all.size() / count]);
    altered_.back().area *= static_cast<double>(all.size()) / static_cast<double>(count);
  }
}

double ChangeReach::squareAt(const Place& place, const Eye& eye, const scene::Bvh& own, const scene::PatchScene* other,
                             const scene::Bvh* tree_of_other) {
  const glm::dvec3 way = place.point - eye.origin;
  const double distance = glm::length(way), rise = glm::dot(way, eye.normal);
  if (!(rise > 0.0)) return 0.0;
  const glm::dvec3 towards = way / distance;
  const double sent = rise / distance;
  const double here = irradiance(eye.area, sent * std::abs(glm::dot(towards, place.normal)), distance);
  if (here <= 0.0 || own.meets(eye.origin, towards, kLift, distance * (1.0 - kHides))) return 0.0;
  double there = 0.0;
  if (other != nullptr) {
    if (const auto hit = tree_of_other->nearestHit(eye.origin, towards, kLift, kFar)) {
      const auto facing = std::abs(glm::dot(towards, glm::dvec3(other->triangles[hit->triangle].normal)));
      there = irradiance(eye.area, sent * facing, hit->t);
    }
  }
  // What arrives here, or no longer does, arrives no longer there, or does: the same flux in the mean over a wider
  // area.
  return std::min(here * place.area, eye.area) * (here + there);
}

double ChangeReach::of(const glm::vec3& origin, const glm::vec3& normal, double area, std::uint32_t turn) const {
  const Eye eye{glm::dvec3(origin), glm::dvec3(normal), area};
  double square = 0.0;
  const auto sum = [&](const Places& places, const scene::Bvh& own, const scene::PatchScene* other,
                       const scene::Bvh* tree_of_other) {
    // Fewer turns where there are few places, so that each has some.
    const auto turns = std::clamp<std::size_t>(places.size() / (kPlaces / kTurns), 1, kTurns);
    for (auto i = turn % turns; i < places.size(); i += turns)
      square += static_cast<double>(turns) * squareAt(places[i], eye, own, other, tree_of_other);
  };
  sum(gone_, *tree_before_, &after_, tree_after_.get());
  sum(come_, *tree_after_, &before_, tree_before_.get());
  sum(altered_, *tree_after_, nullptr, nullptr);
  return std::sqrt(square);
}

}  // namespace radiosity::solver
