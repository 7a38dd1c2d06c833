// Which of many closed parts (solid_parts.h) may hold a place: those between whose planes it lies, eight of them held
// against it together. Immutable once built, so any number of threads may ask.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/geometry/wide_nodes.h"

namespace radiosity::scene {

class ClosedParts {
 public:
  /// Its bounds, and planes that face as its largest triangle does: a slab that leans fills little of its bounds, and
  /// all of what lies between its faces.
  struct Part {
    std::uint32_t number;
    glm::vec3 low, high;
    glm::vec3 normal{0.0F};
    float lowest, highest;  ///< of its corners, along the normal

    Part(std::uint32_t of, std::span<const Bvh::Triangle> triangles);
  };

  ClosedParts() = default;
  /// O(n log n).
  explicit ClosedParts(std::span<const Part> parts);
  [[nodiscard]] std::size_t size() const { return count_; }

  /// Goes from one eight of parts to the next. `work`: grows by what that takes (Hits).
  class Search {
   public:
    Search(const ClosedParts& parts, const glm::vec3& place) : parts_(parts), place_(place) {
      if (!parts.nodes_.empty()) waiting_[depth_++] = 0;
    }
    /// Part::number of those that may hold the place, some at a time; empty: that was all.
    [[nodiscard]] std::span<const std::uint32_t> next(std::uint64_t& work) noexcept;

   private:
    const ClosedParts& parts_;
    glm::vec3 place_;
    std::size_t depth_ = 0;
    std::array<std::uint32_t, WideNodes::kStackDepth> waiting_;
    std::array<std::uint32_t, WideNodes::kWidth> found_;
  };

 private:
  using Lanes = std::array<float, WideNodes::kWidth>;
  /// Lanes without a part have planes that nothing lies between.
  struct alignas(32) Block {
    std::array<Lanes, 3> low, high, normal;
    Lanes lowest, highest;
    std::array<std::uint32_t, WideNodes::kWidth> number;
  };
  [[nodiscard]] static std::uint32_t holding(const Block& block, const glm::vec3& place);
  [[nodiscard]] static std::uint32_t holding(const WideNodes::Node& node, const glm::vec3& place);

  std::size_t count_ = 0;
  std::vector<Block> blocks_;
  WideNodes nodes_;
};

}  // namespace radiosity::scene
