// Finds the closed solids of a scene: connected triangles in which every edge is shared by exactly two, running
// opposite ways, which nowhere cross each other, and which enclose a positive volume. From outside such a solid its
// back faces can never be seen, so they need not be drawn. Pure functions of values.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/patch_scene.h"

namespace radiosity::gpu {

struct ClosedSolids {
  struct Bounds {
    glm::vec3 low, high;
  };
  std::vector<std::uint32_t> solid_of;  ///< by triangle; scene::kNone: not part of a closed solid
  std::vector<Bounds> bounds;           ///< by solid
};

/// Corners belong together when their positions are equal, bit by bit.
[[nodiscard]] ClosedSolids findClosedSolids(const scene::PatchScene& patches);

}  // namespace radiosity::gpu
