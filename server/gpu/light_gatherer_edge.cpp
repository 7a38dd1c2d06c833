// Visibility of a polygon of which only part lies in front of a receiver's plane, but near to the receiver: a wall's
// foot and a piece of floor that reaches out from under the wall. A point on the polygon may seldom lie in that part.
// When it does, it would count for all those that do not, and make one texel far too bright. And of many points the few
// that are nearest to the receiver would tell of them all. So the receiver asks by rays, one for each point, drawn as
// the light of the part itself would arrive.
#include <bit>
#include <glm/geometric.hpp>

#include "server/gpu/light_gatherer.h"
#include "server/solver/near_edge.h"
#include "server/solver/polygon_directions.h"

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

}  // namespace

bool LightGatherer::mayHaveEdges(const solver::GatherShot& shot) const {
  return shot.fill >= 1.0F && receivers_->patches().opacity.empty();
}

bool LightGatherer::isEdge(std::size_t lit) const {
  const float front = lit_.front[lit];
  return front < 1.0F && lit_.form_factor[lit] > solver::kNearEdge * front;
}

void LightGatherer::addEdge(std::size_t lit) {
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
  for (auto& edge : edges_) {
    const auto i = edge.lit;
    const glm::vec3 at(lit_.x[i], lit_.y[i], lit_.z[i]), normal(lit_.nx[i], lit_.ny[i], lit_.nz[i]);
    Draw draw(point.origin, at);
    const auto& part = parts_[edge.part];
    const solver::PolygonDirections directions(at, normal, std::span(part.corner.data(), part.count));
    const auto direction = directions.draw([&draw] { return draw.next(); });
    const glm::dvec3 light_normal(shot.normal);
    const double along = glm::dot(light_normal, glm::dvec3(part.corner[0]) - glm::dvec3(at));
    const double slope = glm::dot(light_normal, direction);
    if (slope >= 0.0 || along >= 0.0) continue;
    if (!receivers_->isBlocked({at, normal, glm::vec3(direction * (along / slope)), 1.0F, 0.0F}))
      edge.seen[half] += 1.0F;
  }
}

void LightGatherer::takeEdges(std::size_t half, std::size_t points) {
  for (const auto& edge : edges_) lit_.visibility[edge.lit] = edge.seen[half] / static_cast<float>(points);
}

}  // namespace radiosity::gpu
