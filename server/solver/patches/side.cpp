#include "server/solver/patches/side.h"

#include <algorithm>

namespace radiosity::solver {

std::vector<Side> makeSides(const scene::PatchScene& patches) {
  std::vector<Side> sides;
  std::uint32_t values = 0;
  const auto hasBoth = [](const scene::Surface& surface) {
    return surface.first_node[0] != scene::kNone && surface.first_node[1] != scene::kNone;
  };
  for (std::uint32_t s = 0; s < patches.surfaces.size(); ++s) {
    const auto& surface = patches.surfaces[s];
    for (std::uint32_t face = 0; face < 2; ++face) {
      if (surface.first_node[face] == scene::kNone) continue;
      Side side;
      side.number = static_cast<std::uint32_t>(sides.size());
      side.surface = s;
      side.side = face;
      if (hasBoth(surface)) side.other = face == 0 ? side.number + 1 : side.number - 1;
      side.first_node = side.key = surface.first_node[face];
      side.triangle_key = surface.first_triangle;
      side.width = surface.width;
      side.height = surface.height;
      side.level_count = surface.level_count;
      side.leaf_count = surface.width * surface.height;
      side.node_count = scene::levelGrid(side.width, side.height, side.level_count).offset;
      side.first_value = values;
      values += side.leaf_count;
      sides.push_back(side);
    }
  }
  sides.shrink_to_fit();
  return sides;
}

std::vector<float> leafAreas(const scene::PatchScene& patches, const std::vector<Side>& sides) {
  std::vector<float> areas;
  if (!sides.empty()) areas.reserve(sides.back().first_value + sides.back().leaf_count);
  for (const auto& side : sides) {
    const auto leaves = patches.node_area.begin() + side.first_node;
    areas.insert(areas.end(), leaves, leaves + side.leaf_count);
  }
  return areas;
}

LeafRect leafRect(const Side& side, const NodePlace& node) {
  return {node.x << node.level, node.y << node.level, std::min((node.x + 1) << node.level, side.width),
          std::min((node.y + 1) << node.level, side.height)};
}

std::uint32_t nodeId(const Side& side, const NodePlace& node) {
  const auto grid = scene::levelGrid(side.width, side.height, node.level);
  return side.first_node + grid.offset + node.y * grid.width + node.x;
}

}  // namespace radiosity::solver
