#include "tests/benchmark/gpu_rays/wide_tree.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace radiosity::benchmarks {
namespace {

using scene::Bounds;
using scene::kNone;

constexpr int kBins = 32;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

float halfArea(const Bounds& box) {
  if (box.empty()) return 0.0F;
  const glm::vec3 d = box.max - box.min;
  return d.x * d.y + d.y * d.z + d.z * d.x;
}

/// Of one triangle each, at its leaves.
struct BinaryNode {
  Bounds box;
  std::uint32_t first = 0, count = 0;  ///< triangles, in the order of the tree
  std::uint32_t left = kNone;          ///< the right child follows it; kNone: a leaf
};

class BinaryTree {
 public:
  explicit BinaryTree(std::span<const scene::Bvh::Triangle> triangles) : order_(triangles.size()) {
    std::iota(order_.begin(), order_.end(), 0U);
    for (const auto& triangle : triangles) {
      Bounds box;
      for (const auto& corner : triangle) box.add(corner);
      boxes_.push_back(box);
    }
    nodes_.push_back({{}, 0, static_cast<std::uint32_t>(triangles.size()), kNone});
    for (std::size_t n = 0; n < nodes_.size(); ++n) {
      const auto node = nodes_[n];
      Bounds box;
      for (auto i = node.first; i < node.first + node.count; ++i) box.add(boxes_[order_[i]]);
      nodes_[n].box = box;
      if (node.count <= 1) continue;
      const auto left = split(node.first, node.count);
      nodes_[n].left = static_cast<std::uint32_t>(nodes_.size());
      nodes_.push_back({{}, node.first, left, kNone});
      nodes_.push_back({{}, node.first + left, node.count - left, kNone});
    }
  }
  [[nodiscard]] const std::vector<BinaryNode>& nodes() const { return nodes_; }
  [[nodiscard]] const std::vector<std::uint32_t>& order() const { return order_; }

 private:
  [[nodiscard]] glm::vec3 centre(std::uint32_t triangle) const {
    return 0.5F * (boxes_[triangle].min + boxes_[triangle].max);
  }
  struct Plane {
    int axis = -1, bin = 0;
    float cost = kInfinity;
  };
  struct Bins {
    float low = 0.0F, scale = 0.0F;
    [[nodiscard]] int of(float where) const {
      return std::clamp(static_cast<int>((where - low) * scale), 0, kBins - 1);
    }
  };
  [[nodiscard]] Bins binsAlong(int axis, const Bounds& spread) const {
    return {spread.min[axis], static_cast<float>(kBins) / (spread.max[axis] - spread.min[axis])};
  }
  void findPlane(std::span<const std::uint32_t> part, int axis, const Bins& bins, Plane& best) const {
    std::array<Bounds, kBins> boxes;
    std::array<std::uint32_t, kBins> counts{};
    for (const auto t : part) {
      const auto bin = static_cast<std::size_t>(bins.of(centre(t)[axis]));
      ++counts[bin];
      boxes[bin].add(boxes_[t]);
    }
    std::array<float, kBins> above{};
    Bounds box;
    std::uint32_t count = 0;
    for (std::size_t bin = kBins - 1; bin > 0; --bin) {
      box.add(boxes[bin]);
      above[bin] = halfArea(box) * static_cast<float>(count += counts[bin]);
    }
    box = {};
    count = 0;
    for (std::size_t bin = 0; bin + 1 < kBins; ++bin) {
      box.add(boxes[bin]);
      count += counts[bin];
      const float cost = halfArea(box) * static_cast<float>(count) + above[bin + 1];
      if (count > 0 && count < part.size() && cost < best.cost) best = {axis, static_cast<int>(bin), cost};
    }
  }
  /// How many of a part go left, which then come first; never all or none.
  std::uint32_t split(std::uint32_t first, std::uint32_t count) {
    const auto part = std::span(order_).subspan(first, count);
    Bounds spread;
    for (const auto t : part) spread.add(centre(t));
    Plane best;
    for (int axis = 0; axis < 3; ++axis)
      if (spread.max[axis] > spread.min[axis]) findPlane(part, axis, binsAlong(axis, spread), best);
    if (best.axis < 0) return count / 2;
    const auto bins = binsAlong(best.axis, spread);
    const auto middle = std::partition(part.begin(), part.end(),
                                       [&](std::uint32_t t) { return bins.of(centre(t)[best.axis]) <= best.bin; });
    const auto left = static_cast<std::uint32_t>(middle - part.begin());
    return left == 0 || left == count ? count / 2 : left;
  }

  std::vector<Bounds> boxes_;
  std::vector<std::uint32_t> order_;
  std::vector<BinaryNode> nodes_;  ///< children follow their parents
};

/// The cheapest way to stand for a binary node by up to so many nodes of a wide tree.
class Collapse {
 public:
  Collapse(const BinaryTree& binary, const TreeCosts& costs) : binary_(binary), costs_(costs) {
    plans_.resize(binary.nodes().size());
    for (auto n = plans_.size(); n-- > 0;) plan(static_cast<std::uint32_t>(n));
  }
  [[nodiscard]] bool isLeaf(std::uint32_t node) const { return plans_[node].leaf; }
  /// What a wide node made of this one has for children.
  [[nodiscard]] std::vector<std::uint32_t> childrenOf(std::uint32_t node) const {
    std::vector<std::uint32_t> children;
    const auto left = binary_.nodes()[node].left, to_left = std::uint32_t{plans_[node].of_inner};
    gather(left, to_left, children);
    gather(left + 1, costs_.width - to_left, children);
    return children;
  }

 private:
  static constexpr std::uint32_t kMost = WideNode::kMostChildren;
  struct Plan {
    std::array<float, kMost> cost{};            ///< by how many nodes there may be, from 1 on
    std::array<std::uint8_t, kMost> to_left{};  ///< of so many; 0: one fewer is as cheap, or there is but one
    std::uint8_t of_inner = 0;                  ///< likewise, of the children of an inner node
    bool leaf = false;
  };
  /// Cheapest way to share `count` nodes among both children.
  [[nodiscard]] std::pair<float, std::uint8_t> share(std::uint32_t left, std::uint32_t count) const {
    std::pair<float, std::uint8_t> best{kInfinity, std::uint8_t{0}};
    for (std::uint32_t k = 1; k < count; ++k) {
      const float cost = plans_[left].cost[k] + plans_[left + 1].cost[count - k];
      if (cost < best.first) best = {cost, static_cast<std::uint8_t>(k)};
    }
    return best;
  }
  void plan(std::uint32_t n) {
    const auto& node = binary_.nodes()[n];
    auto& plan = plans_[n];
    const float area = halfArea(node.box);
    const float as_leaf = node.count <= costs_.most_in_leaf || node.left == kNone
                              ? area * costs_.triangle * static_cast<float>(node.count)
                              : kInfinity;
    plan.leaf = true;
    plan.cost.fill(as_leaf);
    if (node.left == kNone) return;
    const auto [below, to_left] = share(node.left, costs_.width);
    plan.of_inner = to_left;
    plan.leaf = as_leaf <= below + area * costs_.node;
    plan.cost[1] = plan.leaf ? as_leaf : below + area * costs_.node;
    for (std::uint32_t count = 2; count < costs_.width; ++count) {
      const auto [cost, k] = share(node.left, count);
      const bool cheaper = cost < plan.cost[count - 1];
      plan.cost[count] = cheaper ? cost : plan.cost[count - 1];
      plan.to_left[count] = cheaper ? k : std::uint8_t{0};
    }
  }
  void gather(std::uint32_t n, std::uint32_t count, std::vector<std::uint32_t>& to) const {
    while (count > 1 && plans_[n].to_left[count] == 0) --count;
    if (count == 1) return to.push_back(n);
    const auto left = binary_.nodes()[n].left, to_left = std::uint32_t{plans_[n].to_left[count]};
    gather(left, to_left, to);
    gather(left + 1, count - to_left, to);
  }

  const BinaryTree& binary_;
  const TreeCosts& costs_;
  std::vector<Plan> plans_;
};

/// Which child lies in which slot: those that are met first by rays of an octant where these look first.
std::array<std::uint32_t, WideNode::kMostChildren> slotsOf(const std::vector<BinaryNode>& nodes, const Bounds& box,
                                                           const std::vector<std::uint32_t>& children,
                                                           std::uint32_t width) {
  constexpr std::uint32_t kMost = WideNode::kMostChildren;
  std::array<std::uint32_t, kMost> slots;
  slots.fill(kNone);
  if (width < kMost) {  // whoever walks these sorts them
    std::copy(children.begin(), children.end(), slots.begin());
    return slots;
  }
  std::vector<bool> placed(children.size(), false);
  for (std::size_t turn = 0; turn < children.size(); ++turn) {
    float least = kInfinity;
    std::size_t which = 0, where = 0;
    for (std::size_t c = 0; c < children.size(); ++c) {
      if (placed[c]) continue;
      const auto& child = nodes[children[c]].box;
      const glm::vec3 way = child.min + child.max - box.min - box.max;
      for (std::size_t slot = 0; slot < kMost; ++slot) {
        if (slots[slot] != kNone) continue;
        const float cost = ((slot & 4U) != 0 ? -way.x : way.x) + ((slot & 2U) != 0 ? -way.y : way.y) +
                           ((slot & 1U) != 0 ? -way.z : way.z);
        if (cost < least) least = cost, which = c, where = slot;
      }
    }
    if (least == kInfinity) {  // a box that is not a number
      which = static_cast<std::size_t>(std::ranges::find(placed, false) - placed.begin());
      where = static_cast<std::size_t>(std::ranges::find(slots, kNone) - slots.begin());
    }
    placed[which] = true;
    slots[where] = children[which];
  }
  return slots;
}

}  // namespace

WideTree buildWideTree(std::span<const scene::Bvh::Triangle> triangles, const TreeCosts& costs) {
  WideTree tree;
  tree.width = costs.width;
  const BinaryTree binary(triangles);
  const Collapse collapse(binary, costs);
  const auto& nodes = binary.nodes();
  struct Task {
    std::uint32_t node, depth;
  };
  std::vector<Task> tasks{{0, 1}};  // of the nodes of the tree, in their order
  for (std::size_t n = 0; n < tasks.size(); ++n) {
    const auto task = tasks[n];
    tree.depth = std::max(tree.depth, task.depth);
    const bool lone = collapse.isLeaf(task.node);  // the root alone: so small a scene
    const auto children = lone ? std::vector<std::uint32_t>{task.node} : collapse.childrenOf(task.node);
    const auto slots = slotsOf(nodes, nodes[task.node].box, children, costs.width);
    WideNode wide;
    for (std::size_t slot = 0; slot < slots.size(); ++slot) {
      if (slots[slot] == kNone) continue;
      const auto& from = nodes[slots[slot]];
      auto& child = wide.child[slot];
      child.box = from.box;
      if (lone || collapse.isLeaf(slots[slot])) {
        child.first = static_cast<std::uint32_t>(tree.order.size());
        child.triangles = from.count;
        const auto begin = binary.order().begin() + from.first;
        tree.order.insert(tree.order.end(), begin, begin + from.count);
      } else {
        child.node = static_cast<std::uint32_t>(tasks.size());
        tasks.push_back({slots[slot], task.depth + 1});
      }
    }
    tree.nodes.push_back(wide);
  }
  return tree;
}

}  // namespace radiosity::benchmarks
