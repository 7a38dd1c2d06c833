// Visibility of a polygon of which only part lies in front of a receiver's plane, but near to the receiver: a wall's
// foot and a piece of floor that reaches out from under the wall. A point on the polygon may seldom lie in that part.
// When it does, it would count for all those that do not, and make one texel far too bright. And of many points the few
// that are nearest to the receiver would tell of them all. So the receiver asks by rays, one for each point, drawn as
// the light of the part itself would arrive.
#include <algorithm>
#include <array>
#include <bit>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/task.h"
#include "server/gpu/gather/light_gatherer.h"
#include "server/solver/math/near_edge.h"
#include "server/solver/math/polygon_directions.h"
#include "server/solver/math/polygon_form_factor.h"

namespace radiosity::gpu {
namespace {

/// Numbers that are as good as random, made of the two places that are looked at and from, which are the same
/// wherever, and with whatever other receivers, the shot is taken.
class Draw {
 public:
  Draw(const glm::vec3& a, const glm::vec3& b) {
    for (const float value : {a.x, a.y, a.z, b.x, b.y, b.z}) mix(std::bit_cast<std::uint32_t>(value));
  }
  /// In [0, 1).
  double next() {
    mix(0x9e3779b9U);
    return static_cast<double>(state_) * 0x1p-32;
  }

 private:
  /// The finalizer of MurmurHash3, which is in the public domain.
  void mix(std::uint32_t value) {
    state_ = (state_ ^ value) + 0x9e3779b9U;
    state_ = (state_ ^ (state_ >> 16U)) * 0x85ebca6bU;
    state_ = (state_ ^ (state_ >> 13U)) * 0xc2b2ae35U;
    state_ ^= state_ >> 16U;
  }
  std::uint32_t state_ = 0;
};

/// A plane that leaves more than this of the polygon cuts off no more than rounding, or next to nothing.
constexpr double kCutOff = 0.999;
/// A leaf that shines so far shines everywhere: areas are in single precision.
constexpr double kWhole = 0.998;

}  // namespace

bool LightGatherer::isEdge(const solver::GatherShot& shot, std::size_t lit, double front) const {
  if (shot.fill < 1.0F && shot.triangle == scene::kNone) return false;
  return front<kCutOff&& static_cast<double>(lit_.form_factor[lit])> static_cast<double>(solver::kNearEdge) * front &&
         receivers_->patches().opacity.empty();
}

/// How much of what is around `place` on the polygon shines, before the plane of the receiver at `at`: 0 in a hole. Of
/// leaves whose spots are known, whether one is near: rays meet once more what hides the rest, if that is a solid.
double LightGatherer::shiningAt(const solver::GatherShot& shot, const glm::vec3& place, const glm::vec3& at,
                                const glm::vec3& normal) const {
  const auto& patches = receivers_->patches();
  const auto& frame = patches.triangles[shot.triangle];
  const auto& surface = patches.surfaces[patches.triangle_surface[shot.triangle]];
  const auto here = Receivers::texelAt(frame, place), texel = glm::floor(here);
  const auto width = static_cast<float>(surface.width), height = static_cast<float>(surface.height);
  if (!(texel.x >= 0.0F && texel.x < width && texel.y >= 0.0F && texel.y < height)) return 0.0;
  const auto leaf = static_cast<std::uint32_t>(texel.y) * surface.width + static_cast<std::uint32_t>(texel.x);
  const auto corner = frame.origin + texel.x * frame.du + texel.y * frame.dv;
  const std::array corners{corner, corner + frame.du, corner + frame.du + frame.dv, corner + frame.dv};
  const double area = solver::polygonArea(corners);
  const double fill = static_cast<double>(patches.node_area[surface.first_node[shot.side] + leaf]) / area;
  if (fill <= 0.0 || fill >= kWhole) return fill;
  const auto& point = patches.leaves[surface.first_leaf + leaf];
  if (!point.full && point.hasSpots()) return patches.spots.isNear(point.spot_list, here) ? 1.0 : 0.0;
  const auto before = clipToPlane(corners, at, normal);
  return shining(fill, solver::polygonArea(std::span(before.corner.data(), before.count)) / area);
}

void LightGatherer::addEdge(std::size_t lit) {
  lit_.front[lit] = 1.0F;  // of what it looks at
  edges_.push_back({static_cast<std::uint32_t>(lit), static_cast<std::uint32_t>(parts_.size() - 1), {}});
}

void LightGatherer::clearEdges() {
  edges_.clear();
  parts_.clear();
}

void LightGatherer::beginEdges() {
  for (auto& edge : edges_) edge.seen = {};
}

void LightGatherer::lookFromEdges(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                                  std::size_t half) {
  for (; asked_.edges < edges_.size(); ++asked_.edges) {
    interruptionPoint();
    auto& edge = edges_[asked_.edges];
    const auto i = edge.lit;
    const glm::vec3 at(lit_.x[i], lit_.y[i], lit_.z[i]), normal(lit_.nx[i], lit_.ny[i], lit_.nz[i]);
    Draw draw(point.origin, at);
    const auto& part = parts_[edge.part];
    if (part.count < 3) continue;  // no more than rounding
    const solver::PolygonDirections directions(at, normal, std::span(part.corner.data(), part.count));
    const auto direction = directions.draw([&draw] { return draw.next(); });
    const glm::dvec3 light_normal(shot.normal);
    const double along = glm::dot(light_normal, glm::dvec3(part.corner[0]) - glm::dvec3(at));
    const double slope = glm::dot(light_normal, direction);
    if (slope >= 0.0 || along >= 0.0) continue;
    const glm::vec3 way(direction * (along / slope));
    if (shot.fill < 1.0F && draw.next() >= shiningAt(shot, at + way, at, normal)) continue;
    if (!receivers_->isBlocked({at, normal, way, 1.0F, 0.0F})) edge.seen[half] += 1.0F;
  }
}

void LightGatherer::takeEdges(std::size_t half, std::size_t points) {
  for (const auto& edge : edges_) lit_.visibility[edge.lit] = edge.seen[half] / static_cast<float>(points);
}

}  // namespace radiosity::gpu
