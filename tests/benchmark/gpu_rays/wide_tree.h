// A tree of boxes with up to eight children a node, and how shaders are given it. For measurements of rays on a card.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/geometry/bounds.h"
#include "server/geometry/bvh.h"
#include "server/scene/values/scene.h"

namespace radiosity::benchmarks {

struct WideNode {
  static constexpr std::uint32_t kMostChildren = 8;
  struct Child {
    scene::Bounds box;
    std::uint32_t node = scene::kNone;       ///< of an inner child: its number
    std::uint32_t first = 0, triangles = 0;  ///< of a leaf: into WideTree::order
    [[nodiscard]] bool isInner() const { return node != scene::kNone; }
    [[nodiscard]] bool isEmpty() const { return !isInner() && triangles == 0; }
  };
  /// By slot: rays whose direction is negative along the axes that are set in `octant` (4: x, 2: y, 1: z) meet slot
  /// k ^ octant after k, about.
  std::array<Child, kMostChildren> child;
};

struct WideTree {
  std::uint32_t width = 2;
  std::uint32_t depth = 0;           ///< nodes from the root to the farthest one
  std::vector<WideNode> nodes;       ///< breadth first: inner children of a node follow each other, by slot
  std::vector<std::uint32_t> order;  ///< triangles, leaf after leaf, by node and slot
};

struct TreeCosts {
  std::uint32_t width = 2;         ///< 2, 4 or 8
  std::uint32_t most_in_leaf = 3;  ///< triangles
  float node = 1.0F, triangle = 0.3F;
};

/// Surface area heuristic over three axes, then the cheapest tree of that width which its nodes allow (Ylitie, Karras
/// and Laine 2017, "Efficient incoherent ray traversal on GPUs through compressed wide BVHs"). O(n log n).
[[nodiscard]] WideTree buildWideTree(std::span<const scene::Bvh::Triangle> triangles, const TreeCosts& costs);

/// Words for the shaders: tree2.glsl, tree4.glsl and tree8.glsl say what they mean.
[[nodiscard]] std::vector<std::uint32_t> nodeWords(const WideTree& tree);
/// Twelve words a triangle, in the order of the tree: corner and slack, edge and number, other edge.
[[nodiscard]] std::vector<std::uint32_t> triangleWords(const WideTree& tree,
                                                       std::span<const scene::Bvh::Triangle> triangles);

}  // namespace radiosity::benchmarks
