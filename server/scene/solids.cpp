#include "server/scene/solids.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <optional>
#include <tuple>
#include <utility>

#include "server/scene/coverage.h"

namespace radiosity::scene {
namespace {

/// What lies on each other faces the same way: cosine of the angle between. Planes of such are no farther apart where
/// the scene is (unit box) unless they meet at an angle.
constexpr float kSameWay = 0.9999F;
constexpr double kSamePlane = 2e-5;
/// So many places of a leaf are looked at for what covers it.
constexpr std::uint32_t kPlaces = 16;
/// So many rays that say the same are enough. More where a place would be lost.
constexpr std::uint32_t kAgreeOutside = 3, kAgreeInside = 6;

/// Of a position in the triangle's plane.
glm::vec2 texelAt(const TriangleFrame& frame, const glm::vec3& position) {
  const glm::dvec3 u(frame.du), v(frame.dv), way = glm::dvec3(position) - glm::dvec3(frame.origin);
  const double uu = glm::dot(u, u), uv = glm::dot(u, v), vv = glm::dot(v, v);
  const double along_u = glm::dot(way, u), along_v = glm::dot(way, v), determinant = uu * vv - uv * uv;
  return {(along_u * vv - along_v * uv) / determinant, (along_v * uu - along_u * uv) / determinant};
}

}  // namespace

Solids::Solids(const PatchScene& patches, const std::vector<bool>& solid) {
  std::vector<Bvh::Triangle> triangles;
  for (std::uint32_t t = 0; t < patches.triangles.size(); ++t) {
    if (!solid[patches.triangle_surface[t]]) continue;
    Bvh::Triangle triangle;
    for (std::size_t c = 0; c < 3; ++c)
      triangle[c] = patches.vertices[patches.indices[std::size_t{3} * t + c]].position;
    triangles.push_back(triangle);
    surface_.push_back(patches.triangle_surface[t]);
    normal_.push_back(patches.triangles[t].normal);
  }
  tree_ = Bvh(std::move(triangles));
}

bool Solids::near(const Bounds& box, std::uint32_t surface) const {
  const glm::vec3 margin(static_cast<float>(2.0 * kBurialLift));
  return tree_.touches(box.min - margin, box.max + margin, surface_, surface);
}

Solids::Answer Solids::ask(const glm::vec3& position, const glm::vec3& normal, Hits& hits, RayNotes* notes) const {
  const glm::dvec3 origin = glm::dvec3(position) + kBurialLift * glm::dvec3(normal);
  auto answer = vote({origin, normal, kNone}, hits, notes);
  answer.buried = answer.buried && !seesOutAlong({origin, normal, kNone}, hits, notes);
  return answer;
}

bool Solids::mayBury(const Bounds& positions, const glm::vec3& normal) const {
  const glm::vec3 lift = static_cast<float>(kBurialLift) * normal;
  return tree_.mayMeetBack(positions.min + lift, positions.max + lift, BurialWays(normal).of(0), kBurialRayLength);
}

/// A first ray that meets no back decides, and so do some that agree. Otherwise the majority of all.
Solids::Answer Solids::vote(const Start& start, Hits& hits, RayNotes* notes) const {
  const BurialWays ways(start.normal);
  std::uint32_t leave = 0, stay = 0;
  for (std::uint32_t way = 0; way < kFirstWayAlong; ++way) {
    if (leavesSolid(start, way, ways.of(way), hits, notes)) {
      ++leave;
    } else {
      ++stay;
      if (way == 0 && std::ranges::all_of(hits, &RayHit::front)) return {};
    }
    if (leave == 0 && stay == kAgreeOutside) return {};
    if (stay == 0 && leave == kAgreeInside) return {true, true};
    if (2 * std::max(leave, stay) > kFirstWayAlong) break;
  }
  return {leave > stay, false};
}

/// Whether a ray along the surface gets, before it leaves a solid, to where most rays leave none, or out of the
/// scene. What it meets first may be a part of the surface, in a hollow, or of another that is buried as well.
bool Solids::seesOutAlong(const Start& start, Hits& hits, RayNotes* notes) const {
  const BurialWays ways(start.normal);
  for (auto way = kFirstWayAlong; way < kBurialWays; ++way) {
    const auto direction = ways.of(way);
    if (leavesSolid(start, way, direction, hits, notes)) continue;
    if (hits.empty()) return true;
    const RayHit first = hits.front();
    const glm::vec3 facing = normal_[first.triangle];
    const auto there = start.origin + first.t * direction + kBurialLift * glm::dvec3(facing);
    if (!vote({there, facing, first.triangle}, hits, notes).buried) return true;
  }
  return false;
}

/// Whether the place that a ray starts from lies in a solid, as that ray tells. Otherwise leaves what it met in `hits`,
/// in order, which no other part of the scene changes.
bool Solids::leavesSolid(const Start& start, std::uint32_t way, const glm::dvec3& direction, Hits& hits,
                         RayNotes* notes) const {
  const auto end = tree_.endOfSolid(start.origin, direction, kBurialRayLength, hits, hits.work);
  if (notes != nullptr) notes->add({start.origin, start.normal, start.triangle, way, end.value_or(kBurialRayLength)});
  return end.has_value();
}

Coincidence::Coincidence(PatchScene& patches) : patches_(patches) {
  std::vector<Bvh::Triangle> triangles;
  for (std::size_t t = 0; t < patches.triangles.size(); ++t)
    triangles.push_back({patches.vertices[patches.indices[3 * t]].position,
                         patches.vertices[patches.indices[3 * t + 1]].position,
                         patches.vertices[patches.indices[3 * t + 2]].position});
  tree_ = Bvh(std::move(triangles));
  least_ = tree_.leastTags(patches.triangle_surface);
}

void Coincidence::run() {
  std::uint64_t count = 0;
  std::pair<std::uint32_t, std::uint32_t> first{kNone, kNone};
  const auto coplanar = coplanarWithEarlier();
  for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
    const std::uint32_t other = coveredBy(s, coplanar[s]);
    covered_.push_back(other != kNone);
    if (other == kNone) continue;
    if (count++ == 0) first = {other, s};
  }
  if (count == 0) return;
  patches_.warnings.push_back(
      fmt::format("{} surfaces lie exactly on an earlier one that faces the same way and is seen instead (the first: "
                  "surface {} of instance {} on surface {} of instance {})",
                  count, first.second, patches_.surfaces[first.second].instance, first.first,
                  patches_.surfaces[first.first].instance));
}

std::uint32_t Coincidence::coveredAt(std::uint32_t s, const glm::vec3& position, const glm::vec3& normal) const {
  const auto triangle = triangleOver(s, position, normal);
  return triangle == kNone ? kNone : patches_.triangle_surface[triangle];
}

/// Of the earliest surface that covers `s` there.
std::uint32_t Coincidence::triangleOver(std::uint32_t s, const glm::vec3& position, const glm::vec3& normal) const {
  const glm::dvec3 n(normal);
  const auto counts = [&](const RayHit& hit) {
    return glm::dot(patches_.triangles[hit.triangle].normal, normal) > kSameWay;
  };
  const auto over =
      tree_.leastHit(glm::dvec3(position) + n * 1e-6, -n, 0.0, 2e-6, patches_.triangle_surface, least_, s, counts);
  return over ? over->triangle : kNone;
}

void Coincidence::keepCovered() {
  for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
    const Surface& surface = patches_.surfaces[s];
    if (!covered_[s] || !surface.planar || surface.first_node[0] == kNone) continue;
    const TriangleFrame& frame = patches_.triangles[surface.first_triangle];
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      if (patches_.node_area[surface.first_node[0] + i] > 0.0F) continue;
      // The middle of a texel that is wider than the surface may lie beside both.
      const glm::dvec2 corner(i % surface.width, i / surface.width);
      auto over = kNone;
      for (std::uint32_t k = 0; k < kPlaces && over == kNone; ++k)
        over = triangleOver(s, positionAt(frame, corner + latticePoint(k, kPlaces)), frame.normal);
      if (over == kNone) continue;
      const auto texel = texelAt(patches_.triangles[over], positionAt(frame, corner + 0.5));
      patches_.covered.push_back({surface.first_leaf + i, patches_.triangle_surface[over], texel});
    }
  }
}

/// By surface: planar, in one plane with an earlier one that reaches into its bounds, and facing the same way. Planes
/// are sorted into cells of distance, and then swept along x; twice, so that no pair lies on both sides of a cell's
/// end.
std::vector<bool> Coincidence::coplanarWithEarlier() const {
  struct Plane {
    std::int64_t cell;
    float low;  ///< along x
    std::uint32_t surface;
  };
  std::vector<bool> found(patches_.surfaces.size(), false);
  for (const double shift : {0.0, 0.5}) {
    std::vector<Plane> planes;
    for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
      const Surface& surface = patches_.surfaces[s];
      if (!surface.planar) continue;
      const TriangleFrame& frame = patches_.triangles[surface.first_triangle];
      const auto distance = static_cast<double>(glm::dot(frame.normal, frame.origin));
      planes.push_back({static_cast<std::int64_t>(std::floor(distance / kSamePlane + shift)), surface.bounds_min.x, s});
    }
    std::ranges::sort(planes, {}, [](const Plane& plane) { return std::tuple(plane.cell, plane.low, plane.surface); });
    for (std::size_t i = 0; i < planes.size(); ++i) {
      const Surface& a = patches_.surfaces[planes[i].surface];
      for (auto k = i + 1; k < planes.size() && planes[k].cell == planes[i].cell &&
                           planes[k].low <= a.bounds_max.x + static_cast<float>(kSamePlane);
           ++k) {
        const auto later = std::max(planes[i].surface, planes[k].surface);
        if (!found[later] && lieTogether(a, patches_.surfaces[planes[k].surface])) found[later] = true;
      }
    }
  }
  return found;
}

/// Of two surfaces in one plane: they face the same way, and their bounds meet.
bool Coincidence::lieTogether(const Surface& a, const Surface& b) const {
  const auto margin = static_cast<float>(kSamePlane);
  return glm::dot(patches_.triangles[a.first_triangle].normal, patches_.triangles[b.first_triangle].normal) >
             kSameWay &&
         !glm::any(glm::greaterThan(a.bounds_min, b.bounds_max + margin)) &&
         !glm::any(glm::greaterThan(b.bounds_min, a.bounds_max + margin));
}

bool Coincidence::mayCover(std::uint32_t s, const Bounds& box) const {
  const glm::vec3 margin(2.0e-6F);
  return covered_[s] && tree_.touches(box.min - margin, box.max + margin, patches_.triangle_surface, s);
}

/// An earlier surface found right at some of this surface's leaf points, or `closely`, at one of them at least.
std::uint32_t Coincidence::coveredBy(std::uint32_t s, bool closely) const {
  const Surface& surface = patches_.surfaces[s];
  const std::uint32_t leaves = surface.width * surface.height;
  const std::uint32_t step = closely ? 1U : std::max(1U, leaves / 16);
  for (std::uint32_t i = step / 2; i < leaves; i += step) {
    const LeafPoint& point = patches_.leaves[surface.first_leaf + i];
    if (point.triangle == kNone) continue;
    const TriangleFrame& frame = patches_.triangles[point.triangle];
    const std::uint32_t other = coveredAt(s, positionAt(frame, glm::dvec2(point.texel)), frame.normal);
    if (other != kNone) return other;
  }
  return kNone;
}

}  // namespace radiosity::scene
