// Which groups of triangles hang together by their corners, and which of these parts are closed all around. Plain
// values, any thread.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/geometry/bvh.h"

namespace radiosity::scene {

struct MeshParts {
  std::vector<std::uint32_t> of_group;  ///< part of each group
  std::vector<bool> closed;             ///< by part: every edge joins two triangles
};

/// `group_of`: by triangle; `instance_of`: by group, since only triangles of one instance hang together. Corners are
/// one where their coordinates are the same bits. O(n log n).
[[nodiscard]] MeshParts findMeshParts(std::span<const Bvh::Triangle> triangles, std::span<const std::uint32_t> group_of,
                                      std::span<const std::uint32_t> instance_of);

}  // namespace radiosity::scene
