// Triangles that lie in one place: the same three corners, bit by bit and in the same order. A file of a few kilobytes
// can have a million of them.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace radiosity::geometry {

struct SameTriangles {
  /// By triangle, the next one with the same corners, by ascending number, or ~0. Empty: no two are the same.
  std::vector<std::uint32_t> next;
  std::vector<bool> follows;  ///< by triangle, whether another one is the same and comes before; or empty

  [[nodiscard]] bool isFirst(std::uint32_t triangle) const { return follows.empty() || !follows[triangle]; }
};

/// O(n), and O(n log n) of corners that somebody chose so that their hashes crowd. `kind`: by triangle; those of
/// another kind are not the same. Empty: all are of one.
[[nodiscard]] SameTriangles findSame(std::span<const std::array<glm::vec3, 3>> triangles,
                                     const std::vector<bool>& kind = {});

/// Of the corners' bits: what findSame() keeps triangles by.
[[nodiscard]] std::uint64_t hashOfCorners(const std::array<glm::vec3, 3>& corners);

}  // namespace radiosity::geometry
