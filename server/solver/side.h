// Sides of surfaces that have patches: the paper's polygons with their quadtrees.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/patch_scene.h"

namespace radiosity::solver {

/// One side of a surface that has patches: the paper's "polygon" with its quadtree.
struct Side {
  std::uint32_t surface = 0;
  std::uint32_t side = 0;        ///< 0 front, 1 back
  std::uint32_t first_node = 0;  ///< level 0 starts here
  std::uint32_t node_count = 0;
  std::uint32_t first_value = 0;  ///< leaf values of this side start here
  std::uint32_t leaf_count = 0;
  std::uint32_t width = 0, height = 0, level_count = 0;
  bool gathered = false;          ///< its emission is delivered by gather shots, not by scatter
  float mean_reflectance = 0.0F;  ///< of the channels too
  bool dirty = true;              ///< received since its last push-pull
  double unshot_power = 0.0;      ///< sum of |unshot| area, all channels; an estimate while dirty
};

/// All sides of the scene; leaf values lie side after side.
[[nodiscard]] std::vector<Side> makeSides(const scene::PatchScene& patches);

/// A node of a side's quadtree: leaves [x 2^level, (x+1) 2^level) x ... of the side's grid.
struct NodePlace {
  std::uint32_t side = 0, level = 0, x = 0, y = 0;
};

/// Leaves of a node, clipped to its side's grid.
struct LeafRect {
  std::uint32_t x0, y0, x1, y1;
};
[[nodiscard]] LeafRect leafRect(const Side& side, const NodePlace& node);
[[nodiscard]] std::uint32_t nodeId(const Side& side, const NodePlace& node);

}  // namespace radiosity::solver
