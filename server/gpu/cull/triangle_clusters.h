// Triangles of a scene in groups of neighbours, so that many can be left out by one look at their box. Immutable values
// made from a scene.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/values/patch_scene.h"

namespace radiosity::gpu {

struct TriangleClusters {
  struct Cluster {
    std::uint32_t first, count;  ///< into `order`
    glm::vec3 centre, extent;    ///< of the box around them; extent: half its sides
  };
  /// Triangles, cluster by cluster; in scene order inside of each, but where faces lie on each other those that emit
  /// come first.
  std::vector<std::uint32_t> order;
  std::vector<Cluster> clusters;
};

/// Halves the triangles along the widest axis of their centres until at most `most` are left. A scene of no more than
/// that keeps its order. O(n log n).
[[nodiscard]] TriangleClusters makeClusters(const scene::PatchScene& patches, std::uint32_t most);

}  // namespace radiosity::gpu
