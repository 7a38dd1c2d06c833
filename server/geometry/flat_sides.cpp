#include "server/geometry/flat_sides.h"

#include <glm/geometric.hpp>

#include "server/geometry/facing_tree.h"

namespace radiosity::scene {
namespace {

/// Stops at the first.
bool hasCompany(const FlatSide& side, std::span<const FlatSide> sides, const FacingTree& tree,
                const LieTogether& lie_together, std::vector<std::uint32_t>& waiting) {
  const auto chord = FacingTree::chordOf(lie_together.same_way);
  waiting.assign(1, 0);
  while (!waiting.empty()) {
    const auto& node = tree.nodes()[waiting.back()];
    waiting.pop_back();
    if (!node.reach.isNear(side.low, side.high, lie_together.margin) || !node.reach.faces(side.normal, chord)) continue;
    if (node.child != 0) {
      waiting.push_back(node.child);
      waiting.push_back(node.child + 1);
      continue;
    }
    for (auto i = node.first; i < node.first + node.count; ++i)
      if (lie_together(side, sides[tree.order()[i]])) return true;
  }
  return false;
}

}  // namespace

bool LieTogether::operator()(const FlatSide& a, const FlatSide& b) const {
  return a.surface != b.surface && glm::dot(a.normal, b.normal) > same_way &&
         !glm::any(glm::greaterThan(a.low, b.high + margin)) && !glm::any(glm::greaterThan(b.low, a.high + margin));
}

std::vector<bool> findCompany(std::span<const FlatSide> sides, const LieTogether& lie_together) {
  std::vector<bool> found(sides.size(), false);
  if (sides.size() < 2) return found;
  std::vector<FacingTree::Item> items;
  items.reserve(sides.size());
  for (const auto& side : sides) items.push_back({side.low, side.high, side.normal});
  const FacingTree tree(items);
  std::vector<std::uint32_t> waiting;
  for (std::size_t i = 0; i < sides.size(); ++i) found[i] = hasCompany(sides[i], sides, tree, lie_together, waiting);
  return found;
}

}  // namespace radiosity::scene
