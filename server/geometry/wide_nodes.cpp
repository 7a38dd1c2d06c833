#include "server/geometry/wide_nodes.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <limits>

namespace radiosity::scene {
namespace {

constexpr float kNoBound = std::numeric_limits<float>::infinity();
/// Sides of boxes around whatever there is.
constexpr float kEverywhere = 1e9F;
/// By which boxes grow (unit box): by more than rounding moves their sides, and where a ray meets them.
constexpr float kGrowth = 2e-6F;

}  // namespace

void TriangleLanes::set(std::size_t lane, const Bvh::Triangle& triangle, float slack_of_edge) {
  const glm::vec3 a = triangle[1] - triangle[0], b = triangle[2] - triangle[0];
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<int>(axis);
    corner[axis][lane] = triangle[0][i];
    edge1[axis][lane] = a[i];
    edge2[axis][lane] = b[i];
  }
  slack[lane] = slack_of_edge * std::max(glm::length(a), glm::length(b));
}

WideNodes::WideNodes(const Bvh& tree, const NumberLeaf& leaf) {
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
      node.plane[axis].fill(kNoBound);
      node.plane[axis + 3].fill(-kNoBound);
    }
    node.child.fill(0);
    std::size_t k = 0;
    for (const auto n : childrenOf(tree, task.from, count)) {
      for (std::size_t axis = 0; axis < 3; ++axis) {
        node.plane[axis][k] = tree.nodes_[n].min[static_cast<int>(axis)] - kGrowth;
        node.plane[axis + 3][k] = tree.nodes_[n].max[static_cast<int>(axis)] + kGrowth;
      }
      if (count[n] <= kWidth || tree.nodes_[n].count > 0) {
        node.child[k++] = addLeaf(leaf, first[n], count[n]);
        continue;
      }
      node.child[k++] = static_cast<std::uint32_t>(nodes_.size());
      pending.push_back({n, static_cast<std::uint32_t>(nodes_.size())});
      nodes_.emplace_back();
    }
    nodes_[task.to] = node;
  }
  nodes_.shrink_to_fit();
}

/// Up to kWidth nodes that make up all of a node: the largest are opened first, and none that fits in a block.
std::vector<std::uint32_t> WideNodes::childrenOf(const Bvh& tree, std::uint32_t node,
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

/// A leaf; where a Bvh that is as deep as it may be has left more than fit in one, as where triangles crowd ever
/// closer to one point, a node above several, none of which a box leaves out.
std::uint32_t WideNodes::addLeaf(const NumberLeaf& leaf, std::uint32_t first, std::uint32_t count) {
  if (count <= kWidth) return kLeaf | leaf(first, count);
  const auto index = static_cast<std::uint32_t>(nodes_.size());
  nodes_.emplace_back();
  Node node;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    node.plane[axis].fill(kNoBound);
    node.plane[axis + 3].fill(-kNoBound);
  }
  node.child.fill(0);
  const std::uint32_t part = std::max(kWidth, (count + kWidth - 1) / kWidth);
  for (std::uint32_t k = 0, from = 0; from < count; ++k, from += part) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      node.plane[axis][k] = -kEverywhere;
      node.plane[axis + 3][k] = kEverywhere;
    }
    node.child[k] = addLeaf(leaf, first + from, std::min(part, count - from));
  }
  nodes_[index] = node;
  return index;
}

}  // namespace radiosity::scene
