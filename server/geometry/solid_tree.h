// Where rays leave the solid that they start in, for very many rays (solids.h): a Bvh with eight boxes below each,
// whose children or triangles are tested together in single precision. What of these a ray may meet is tested in
// double, so that what is found is exact. Immutable once built, so any number of threads may ask.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <vector>

#include "server/geometry/wide_nodes.h"

namespace radiosity::scene {

class SolidTree {
 public:
  SolidTree() = default;
  /// O(n). Refers to the Bvh.
  explicit SolidTree(const Bvh& tree);

  /// Of several trees, of which each numbers its own triangles in `hits`: the first back of a triangle that ends more
  /// solids than fronts began. Looks no farther: what lies behind costs nothing. None: the ray starts in no solid, and
  /// `hits` are all with t in (0, t_max), by t. For rays that start in the unit box, or about. `work`: grows by what
  /// that took, in units of 6 ns or so; from `stop` on nobody looks farther, and none says nothing.
  [[nodiscard]] static std::optional<double> endOfSolid(std::span<const SolidTree* const> trees,
                                                        const glm::dvec3& origin, const glm::dvec3& direction,
                                                        double t_max, std::vector<RayHit>& hits, std::uint64_t& work,
                                                        std::uint64_t stop = ~std::uint64_t{0});

  [[nodiscard]] const Bvh& triangles() const { return *tree_; }

 private:
  static constexpr std::uint32_t kWidth = WideNodes::kWidth;
  /// Slack below nothing: no triangle is there.
  struct Block : TriangleLanes {
    std::uint32_t first;  ///< of the Bvh's triangles
  };
  [[nodiscard]] std::uint32_t addBlock(std::uint32_t first, std::uint32_t count);
  class Walk;
  struct Ray;
  static std::optional<double> follow(std::span<const SolidTree* const> trees, std::uint16_t first, const Ray& from,
                                      bool all, Walk& walk, std::uint64_t& work, std::uint64_t stop) noexcept;
  [[nodiscard]] static std::uint32_t mayMeet(const Block& block, const WideNodes::Ray& ray);

  const Bvh* tree_ = nullptr;
  std::vector<Block> blocks_;  // before the nodes, which number them
  WideNodes nodes_;
};

}  // namespace radiosity::scene
