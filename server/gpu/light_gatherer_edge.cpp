// Visibility of a polygon of which only a small part lies in front of a receiver's plane, but near to the receiver: a
// wall's foot and a piece of floor that reaches out from under the wall. A point on the polygon seldom lies in that
// part. When it does, it would count for all those that do not, and make one texel far too bright. So the receiver asks
// by rays, for points drawn in the part itself.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>

#include "server/gpu/light_gatherer.h"
#include "server/solver/near_edge.h"

namespace radiosity::gpu {
namespace {

/// Each ray goes to one of so many points, by what form factor these have: visibility is the part of the form factor
/// that is seen, and that of points at the near end of the part may be a hundred times that of those at its far end.
constexpr std::size_t kCandidates = 4;

/// Numbers that are as good as random, made of the two places that are looked at and from, which are the same
/// wherever, and with whatever other receivers, the shot is taken.
class Draw {
 public:
  Draw(const glm::vec3& a, const glm::vec3& b) {
    for (const float value : {a.x, a.y, a.z, b.x, b.y, b.z}) mix(std::bit_cast<std::uint32_t>(value));
  }
  /// In [0, 1).
  float next() {
    mix(0x9e3779b9U);
    return static_cast<float>(state_ >> 8U) * 0x1p-24F;
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

/// Evenly over a convex polygon: in one of the triangles from its first corner, by their areas.
glm::vec3 drawPoint(const ClippedPolygon& polygon, Draw& draw) {
  const auto& corner = polygon.corner;
  std::array<float, 16> area{};
  float all = 0.0F;
  for (std::size_t k = 1; k + 1 < polygon.count; ++k)
    all += area[k] = glm::length(glm::cross(corner[k] - corner[0], corner[k + 1] - corner[0]));
  float left = draw.next() * all;
  std::size_t k = 1;
  while (k + 2 < polygon.count && left >= area[k]) left -= area[k++];
  const float across = std::sqrt(draw.next()), along = across * draw.next();
  return corner[0] + (across - along) * (corner[k] - corner[0]) + along * (corner[k + 1] - corner[0]);
}

}  // namespace

bool LightGatherer::isEdge(std::size_t lit) const {
  return lit_.front[lit] < 1.0F && lit_.form_factor[lit] > solver::kNearEdge * lit_.front[lit];
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
    glm::vec3 chosen(0.0F);
    float sum = 0.0F;
    for (std::size_t k = 0; k < kCandidates; ++k) {
      const auto candidate = drawPoint(parts_[edge.part], draw);
      const auto way = candidate - at;
      const float square = glm::dot(way, way);
      const float weight = std::max(0.0F, glm::dot(way, normal)) * std::max(0.0F, -glm::dot(way, shot.normal)) /
                           std::max(square * square, 1e-30F);
      sum += weight;
      if (draw.next() * sum < weight) chosen = way;
    }
    if (sum > 0.0F && !receivers_->isBlocked({at, normal, chosen, 1.0F, 0.0F})) edge.seen[half] += 1.0F;
  }
}

void LightGatherer::takeEdges(std::size_t half, std::size_t points) {
  for (const auto& edge : edges_) lit_.visibility[edge.lit] = edge.seen[half] / static_cast<float>(points);
}

}  // namespace radiosity::gpu
