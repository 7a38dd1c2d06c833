#include "server/scene/ray_tree.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

#include "common/clones.h"

namespace radiosity::scene {
namespace {

constexpr std::size_t kLanes = RayTree::kWidth;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// By which triangles grow, as a ray sees them (unit box): by more than rounding moves it past their edges.
constexpr float kEdge = 5e-7F;
/// Hits no farther apart coincide (unit box): what rounding makes of one place on two triangles.
constexpr float kSame = 1e-6F;

}  // namespace

/// Moller and Trumbore 1997. `t`: infinity where a triangle is missed.
__attribute__((always_inline)) inline void RayTree::meetTriangles(const Block& block, const WideNodes::Ray& ray,
                                                                  float* t, float* turn) {
  const auto& c = block.corner;
  const auto& a = block.edge1;
  const auto& b = block.edge2;
  const float dx = ray.direction[0], dy = ray.direction[1], dz = ray.direction[2];
  for (std::size_t k = 0; k < kLanes; ++k) {
    const float px = dy * b[2][k] - dz * b[1][k];
    const float py = dz * b[0][k] - dx * b[2][k];
    const float pz = dx * b[1][k] - dy * b[0][k];
    const float determinant = a[0][k] * px + a[1][k] * py + a[2][k] * pz, inverse = 1.0F / determinant;
    const float sx = ray.origin[0] - c[0][k], sy = ray.origin[1] - c[1][k], sz = ray.origin[2] - c[2][k];
    const float u = (sx * px + sy * py + sz * pz) * inverse;
    const float qx = sy * a[2][k] - sz * a[1][k], qy = sz * a[0][k] - sx * a[2][k], qz = sx * a[1][k] - sy * a[0][k];
    const float v = (dx * qx + dy * qy + dz * qz) * inverse;
    const float at = (b[0][k] * qx + b[1][k] * qy + b[2][k] * qz) * inverse;
    const float edge = block.slack[k] * std::abs(inverse);
    // Empty lanes, of no area: not a number, so no hit.
    const bool hit = (u >= -edge) & (v >= -edge) & (u + v <= 1.0F + edge) & (at > 0.0F);
    t[k] = hit ? at : kInfinity;
    turn[k] = determinant;
  }
}

RayTree::RayTree(const Bvh& tree)
    : nodes_(tree, [&](std::uint32_t first, std::uint32_t count) { return addBlock(tree, first, count); }) {
  blocks_.shrink_to_fit();
}

std::uint32_t RayTree::addBlock(const Bvh& tree, std::uint32_t first, std::uint32_t count) {
  Block block{};
  for (std::uint32_t k = 0; k < count; ++k) {
    block.set(k, tree.triangles_[first + k], kEdge);
    block.triangle[k] = tree.order_[first + k];
  }
  blocks_.push_back(block);
  return static_cast<std::uint32_t>(blocks_.size() - 1);
}

RADIOSITY_CLONES bool RayTree::nearestHit(const glm::vec3& origin, const glm::vec3& direction, float t_max, RayHit& hit,
                                          std::span<const std::uint32_t> passed, std::uint32_t own) const {
  if (nodes_.empty()) return false;
  const WideNodes::Ray ray(origin, direction);
  struct Task {
    std::uint32_t child;
    float entry;
  };
  Task stack[WideNodes::kStackDepth];
  std::size_t depth = 1;
  stack[0] = {0, 0.0F};
  bool found = false;
  float nearest = t_max, reach = t_max;  // what lies as near as the nearest is looked at, too
  alignas(32) float lane[kLanes], turn[kLanes];
  while (depth > 0) {
    const Task task = stack[--depth];
    if (task.entry > reach) continue;
    if ((task.child & WideNodes::kLeaf) != 0) {
      const Block& block = blocks_[task.child & ~WideNodes::kLeaf];
      meetTriangles(block, ray, lane, turn);
      for (std::size_t k = 0; k < kLanes; ++k) {
        const bool ties = found && std::abs(lane[k] - nearest) <= kSame;
        if ((!ties && !(lane[k] < nearest)) || block.triangle[k] == own) continue;
        if (!passed.empty() && std::ranges::find(passed, block.triangle[k]) != passed.end()) continue;
        const bool front = turn[k] > 0.0F;
        if (ties && (front != hit.front ? hit.front : hit.triangle < block.triangle[k])) continue;
        nearest = lane[k];
        reach = std::min(t_max, nearest + kSame);
        hit.triangle = block.triangle[k];
        hit.front = front;
        found = true;
      }
      continue;
    }
    const auto& node = nodes_[task.child];
    const std::size_t base = depth;
    for (std::uint32_t mask = WideNodes::meet(node, ray, reach, lane); mask != 0; mask &= mask - 1) {
      const auto k = static_cast<std::size_t>(std::countr_zero(mask));
      const Task next{node.child[k], lane[k]};
      std::size_t at = depth++;  // the nearest is taken first
      for (; at > base && stack[at - 1].entry < next.entry; --at) stack[at] = stack[at - 1];
      stack[at] = next;
    }
  }
  hit.t = static_cast<double>(nearest);
  return found;
}

}  // namespace radiosity::scene
