// Sides of surfaces that have patches: the paper's polygons with their quadtrees.
#pragma once

#include <algorithm>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/values/patch_scene.h"

namespace radiosity::solver {

/// Leaves of many sides, for each of which little is to be done, that a thread is worth: a tenth of a millisecond.
inline constexpr std::size_t kLeavesAThread = 4096;

/// One side of a surface that has patches: the paper's "polygon" with its quadtree.
struct Side {
  std::uint32_t number = 0;  ///< among all sides; by it SideColours knows it
  std::uint32_t surface = 0;
  std::uint32_t side = 0;              ///< 0 front, 1 back
  std::uint32_t other = scene::kNone;  ///< number of the surface's other side, where that has patches, too
  std::uint32_t first_node = 0;        ///< level 0 starts here
  /// For sample sequences, and to know light polygons again: stay with the side whatever an edit does to the numbers of
  /// nodes and triangles. A scene that is no edit of another has its own numbers here: first_node, and the surface's
  /// first triangle.
  std::uint32_t key = 0, triangle_key = 0;
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
/// Unit box squared, by leaf value; 0 where there is no leaf.
[[nodiscard]] std::vector<float> leafAreas(const scene::PatchScene& patches, const std::vector<Side>& sides);

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

/// A leaf under a node chosen with probability proportional to weight(id of a node), which sums up the levels, by
/// warping the point (u, v) down the quadtree, which keeps its stratification. On return (u, v) are uniform in [0, 1)^2
/// again.
template <typename Weight>
[[nodiscard]] std::uint32_t warpToLeaf(const Side& side, const NodePlace& node, const Weight& weight, double& u,
                                       double& v) {
  std::uint32_t x = node.x, y = node.y;
  for (std::uint32_t level = node.level; level-- > 0;) {
    const auto grid = scene::levelGrid(side.width, side.height, level);
    const auto at = [&](std::uint32_t cx, std::uint32_t cy) {
      if (cx >= grid.width || cy >= grid.height) return 0.0;
      return static_cast<double>(weight(side.first_node + grid.offset + cy * grid.width + cx));
    };
    const double p00 = at(2 * x, 2 * y), p10 = at(2 * x + 1, 2 * y);
    const double p01 = at(2 * x, 2 * y + 1), p11 = at(2 * x + 1, 2 * y + 1);
    const double left = (p00 + p01) / (p00 + p10 + p01 + p11);
    const bool right = u >= left;
    u = right ? (u - left) / (1.0 - left) : u / left;
    const double upper = right ? p10 : p00, lower = right ? p11 : p01;
    const double split = upper / (upper + lower);
    const bool down = v >= split;
    v = down ? (v - split) / (1.0 - split) : v / split;
    u = std::clamp(u, 0.0, 1.0 - 1e-12);
    v = std::clamp(v, 0.0, 1.0 - 1e-12);
    x = 2 * x + (right ? 1 : 0);
    y = 2 * y + (down ? 1 : 0);
  }
  return y * side.width + x;
}

}  // namespace radiosity::solver
