#include "server/solver/patches/passing.h"

#include <algorithm>

namespace radiosity::solver {

std::vector<PassingLeaf> passingLeaves(const scene::SideColours& transmittance, const std::vector<Side>& sides,
                                       std::span<const float> areas) {
  std::vector<PassingLeaf> leaves;
  if (transmittance.sideCount() == 0) return leaves;
  for (const auto& side : sides) {
    if (side.other == scene::kNone) continue;
    const auto of_side = transmittance.side(side.number);
    if (of_side.isUniform() && of_side[0] == glm::vec3(0.0F)) continue;
    const auto from = sides[side.other].first_value;
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      if (areas[side.first_value + leaf] > 0.0F && of_side[leaf] != glm::vec3(0.0F))
        leaves.push_back({side.first_value + leaf, from + leaf, of_side[leaf]});
    }
  }
  return leaves;
}

std::span<const PassingLeaf> passingTo(std::span<const PassingLeaf> all, const Side& side) {
  const auto first = std::ranges::lower_bound(all, side.first_value, {}, &PassingLeaf::to);
  const auto end = std::ranges::lower_bound(first, all.end(), side.first_value + side.leaf_count, {}, &PassingLeaf::to);
  return {first, end};
}

}  // namespace radiosity::solver
