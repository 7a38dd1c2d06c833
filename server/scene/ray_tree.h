// The nearest triangle that a ray meets, for very many rays (solver/leaf_sights.h): a Bvh with eight boxes below each,
// whose children or triangles are tested together. Single precision; what lies at an edge counts for both triangles, so
// that no ray slips between two. Of triangles that coincide the one that shows its front is hit, then the first: walls
// of no thickness are two, back to back. Immutable once built, so any number of threads may ask.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/scene/scene.h"
#include "server/scene/shaft.h"
#include "server/scene/wide_nodes.h"

namespace radiosity::scene {

class RayTree {
 public:
  static constexpr std::uint32_t kWidth = WideNodes::kWidth;

  RayTree() = default;
  /// O(n); the Bvh is not needed any more.
  explicit RayTree(const Bvh& tree);

  /// Of the hit with the least t > 0, in units of the direction's length, below t_max; false: none is. `passed`:
  /// triangles that do not count. `own`: that the ray starts on, which it does not meet.
  [[nodiscard]] bool nearestHit(const glm::vec3& origin, const glm::vec3& direction, float t_max, RayHit& hit,
                                std::span<const std::uint32_t> passed = {}, std::uint32_t own = kNone) const;

  /// Which points at the end of a shaft triangles hide from where it begins: 1, or 0, by point. False: more than `most`
  /// triangles may, and it is not known.
  [[nodiscard]] bool hide(const Shaft& shaft, const ShaftPoints& points, std::size_t most, std::int32_t* hidden) const;

 private:
  struct Block : TriangleLanes {
    std::array<std::uint32_t, kWidth> triangle;
  };
  [[nodiscard]] std::uint32_t addBlock(const Bvh& tree, std::uint32_t first, std::uint32_t count);
  static void meetTriangles(const Block& block, const WideNodes::Ray& ray, float* t, float* turn);

  std::vector<Block> blocks_;  // before the nodes, which number them
  WideNodes nodes_;
};

}  // namespace radiosity::scene
