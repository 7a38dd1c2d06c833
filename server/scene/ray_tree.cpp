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
/// Of a tree of 2^32 triangles, seven of eight children waiting at each level.
constexpr std::size_t kStackDepth = 512;
constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// Sides of boxes around whatever there is.
constexpr float kEverywhere = 1e9F;
/// By which boxes grow (unit box): by more than rounding moves their sides, and where a ray meets them.
constexpr float kGrowth = 2e-6F;
/// By which triangles grow, as a ray sees them (unit box): by more than rounding moves it past their edges.
constexpr float kEdge = 5e-7F;
/// Hits no farther apart coincide (unit box): what rounding makes of one place on two triangles.
constexpr float kSame = 1e-6F;
/// Instead of the component of a direction that is 0.
constexpr float kLeast = 1e-20F;

}  // namespace

struct RayTree::Ray {
  float origin[3], direction[3], inverse[3];
  std::size_t near[3], far[3];  ///< which planes of a box it meets first, and last

  Ray(const glm::vec3& from, const glm::vec3& way) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<int>(axis);
      origin[axis] = from[i];
      direction[axis] = way[i];
      inverse[axis] = 1.0F / (std::abs(way[i]) > kLeast ? way[i] : kLeast);
      const bool up = inverse[axis] > 0.0F;
      near[axis] = up ? axis : axis + 3;
      far[axis] = up ? axis + 3 : axis;
    }
  }
};

/// Which children of a node the ray meets before t_max, as bits; `entry`: where it comes in.
__attribute__((always_inline)) inline std::uint32_t RayTree::meetBoxes(const Node& node, const Ray& ray, float t_max,
                                                                       float* entry) {
  const float* near[3];
  const float* far[3];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    near[axis] = node.plane[ray.near[axis]].data();
    far[axis] = node.plane[ray.far[axis]].data();
  }
  std::uint32_t bits[kLanes];
  for (std::size_t k = 0; k < kLanes; ++k) {
    const float ax = (near[0][k] - ray.origin[0]) * ray.inverse[0], bx = (far[0][k] - ray.origin[0]) * ray.inverse[0];
    const float ay = (near[1][k] - ray.origin[1]) * ray.inverse[1], by = (far[1][k] - ray.origin[1]) * ray.inverse[1];
    const float az = (near[2][k] - ray.origin[2]) * ray.inverse[2], bz = (far[2][k] - ray.origin[2]) * ray.inverse[2];
    float in = ax > ay ? ax : ay;
    in = in > az ? in : az;
    in = in > 0.0F ? in : 0.0F;
    float out = bx < by ? bx : by;
    out = out < bz ? out : bz;
    out = out < t_max ? out : t_max;
    entry[k] = in;
    bits[k] = in <= out ? 1U << k : 0U;
  }
  std::uint32_t mask = 0;
  for (std::size_t k = 0; k < kLanes; ++k) mask |= bits[k];
  return mask;
}

/// Moller and Trumbore 1997. `t`: infinity where a triangle is missed.
__attribute__((always_inline)) inline void RayTree::meetTriangles(const Block& block, const Ray& ray, float* t,
                                                                  float* turn) {
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

RayTree::RayTree(const Bvh& tree) {
  if (tree.empty()) return;
  // The triangles below a node lie together: which.
  std::vector<std::uint32_t> first(tree.nodes_.size()), count(tree.nodes_.size());
  for (std::size_t n = tree.nodes_.size(); n-- > 0;) {  // children come after their parents
    const auto& node = tree.nodes_[n];
    first[n] = node.count > 0 ? node.first : std::min(first[node.first], first[node.first + 1]);
    count[n] = node.count > 0 ? node.count : count[node.first] + count[node.first + 1];
  }
  struct Task {
    std::uint32_t from, to;
  };
  std::vector<Task> pending{{0, 0}};
  nodes_.emplace_back();
  while (!pending.empty()) {
    const Task task = pending.back();
    pending.pop_back();
    Node node;
    for (std::size_t axis = 0; axis < 3; ++axis) {  // no ray meets what is empty
      node.plane[axis].fill(kInfinity);
      node.plane[axis + 3].fill(-kInfinity);
    }
    node.child.fill(0);
    std::size_t k = 0;
    for (const auto n : childrenOf(tree, task.from, count)) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        node.plane[axis][k] = tree.nodes_[n].min[static_cast<int>(axis)] - kGrowth;
        node.plane[axis + 3][k] = tree.nodes_[n].max[static_cast<int>(axis)] + kGrowth;
      }
      if (count[n] <= kWidth || tree.nodes_[n].count > 0) {
        node.child[k++] = addLeaf(tree, first[n], count[n]);
        continue;
      }
      node.child[k++] = static_cast<std::uint32_t>(nodes_.size());
      pending.push_back({n, static_cast<std::uint32_t>(nodes_.size())});
      nodes_.emplace_back();
    }
    nodes_[task.to] = node;
  }
}

/// Up to kWidth nodes that make up all of a node: the largest are opened first, and none that fits in a block.
std::vector<std::uint32_t> RayTree::childrenOf(const Bvh& tree, std::uint32_t node,
                                               const std::vector<std::uint32_t>& count) {
  const auto halfArea = [&](std::uint32_t n) {
    const glm::vec3 d = tree.nodes_[n].max - tree.nodes_[n].min;
    return d.x * d.y + d.y * d.z + d.z * d.x;
  };
  std::vector<std::uint32_t> below{node};
  while (below.size() < kWidth) {
    auto largest = below.end();
    for (auto at = below.begin(); at != below.end(); ++at) {
      if (tree.nodes_[*at].count > 0 || count[*at] <= kWidth) continue;
      if (largest == below.end() || halfArea(*at) > halfArea(*largest)) largest = at;
    }
    if (largest == below.end()) break;
    const auto left = tree.nodes_[*largest].first;
    *largest = left;
    below.push_back(left + 1);
  }
  return below;
}

/// A block; where a Bvh that is as deep as it may be has left more than fit in one, as where triangles crowd ever
/// closer to one point, a node above several, none of which a box leaves out.
std::uint32_t RayTree::addLeaf(const Bvh& tree, std::uint32_t first, std::uint32_t count) {
  if (count <= kWidth) return kLeaf | addBlock(tree, first, count);
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  Node node;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    node.plane[axis].fill(kInfinity);
    node.plane[axis + 3].fill(-kInfinity);
  }
  node.child.fill(0);
  const std::uint32_t part = std::max(kWidth, (count + kWidth - 1) / kWidth);
  for (std::uint32_t k = 0, from = 0; from < count; ++k, from += part) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      node.plane[axis][k] = -kEverywhere;
      node.plane[axis + 3][k] = kEverywhere;
    }
    node.child[k] = addLeaf(tree, first + from, std::min(part, count - from));
  }
  nodes_[index] = node;
  return index;
}

std::uint32_t RayTree::addBlock(const Bvh& tree, std::uint32_t first, std::uint32_t count) {
  Block block{};
  for (std::uint32_t k = 0; k < count; ++k) {
    const auto& [a, b, c] = tree.triangles_[first + k];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto i = static_cast<int>(axis);
      block.corner[axis][k] = a[i];
      block.edge1[axis][k] = b[i] - a[i];
      block.edge2[axis][k] = c[i] - a[i];
    }
    block.slack[k] = kEdge * std::max(glm::length(b - a), glm::length(c - a));
    block.triangle[k] = tree.order_[first + k];
  }
  blocks_.push_back(block);
  return static_cast<std::uint32_t>(blocks_.size() - 1);
}

RADIOSITY_CLONES bool RayTree::nearestHit(const glm::vec3& origin, const glm::vec3& direction, float t_max, RayHit& hit,
                                          std::span<const std::uint32_t> passed) const {
  if (nodes_.empty()) return false;
  const Ray ray(origin, direction);
  struct Task {
    std::uint32_t child;
    float entry;
  };
  Task stack[kStackDepth];
  std::size_t depth = 1;
  stack[0] = {0, 0.0F};
  bool found = false;
  float nearest = t_max, reach = t_max;  // what lies as near as the nearest is looked at, too
  alignas(32) float lane[kLanes], turn[kLanes];
  while (depth > 0) {
    const Task task = stack[--depth];
    if (task.entry > reach) continue;
    if ((task.child & kLeaf) != 0) {
      const Block& block = blocks_[task.child & ~kLeaf];
      meetTriangles(block, ray, lane, turn);
      for (std::size_t k = 0; k < kLanes; ++k) {
        if (!passed.empty() && std::ranges::find(passed, block.triangle[k]) != passed.end()) continue;
        const bool front = turn[k] > 0.0F;
        if (found && std::abs(lane[k] - nearest) <= kSame) {
          if (front != hit.front ? hit.front : hit.triangle < block.triangle[k]) continue;
        } else if (!(lane[k] < nearest)) {
          continue;
        }
        nearest = lane[k];
        reach = std::min(t_max, nearest + kSame);
        hit.triangle = block.triangle[k];
        hit.front = front;
        found = true;
      }
      continue;
    }
    const Node& node = nodes_[task.child];
    const std::size_t base = depth;
    for (std::uint32_t mask = meetBoxes(node, ray, reach, lane); mask != 0; mask &= mask - 1) {
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
