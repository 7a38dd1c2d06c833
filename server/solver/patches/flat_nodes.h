// Which nodes of the quadtrees lie in one plane: all of a planar surface, and of others those that no fold crosses, as
// where a file's own lightmap coordinates unfold a room into one chart. Plain values made from a scene.
#pragma once

#include <cstdint>
#include <vector>

#include "server/scene/values/patch_scene.h"

namespace radiosity::solver {

class FlatNodes {
 public:
  explicit FlatNodes(const scene::PatchScene& patches);

  /// The triangle in whose frame all of the node lies; kNone: it is folded or curved, or empty, or a small part of what
  /// is curved everywhere.
  [[nodiscard]] std::uint32_t triangle(std::uint32_t surface, std::uint32_t level, std::uint32_t x,
                                       std::uint32_t y) const;
  /// Whether it is not flat, but wide parts of it are.
  [[nodiscard]] bool isFolded(std::uint32_t surface, std::uint32_t level, std::uint32_t x, std::uint32_t y) const;

 private:
  [[nodiscard]] std::uint32_t at(std::uint32_t surface, std::uint32_t level, std::uint32_t x, std::uint32_t y) const;
  void fill(const scene::Surface& surface, std::vector<std::uint32_t>& nodes) const;
  static void findCurved(const scene::Surface& surface, std::vector<std::uint32_t>& nodes);
  [[nodiscard]] std::uint32_t ofLeaf(const scene::LeafPoint& leaf, const glm::vec2& corner) const;
  [[nodiscard]] bool inOneFrame(std::uint32_t a, std::uint32_t b, const glm::vec2& low, const glm::vec2& high) const;

  const scene::PatchScene& patches_;
  std::vector<std::vector<std::uint32_t>> nodes_;  // by surface, by node; none for planar surfaces
};

}  // namespace radiosity::solver
