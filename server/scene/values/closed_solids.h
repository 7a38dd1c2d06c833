// The closed solids of a scene: connected triangles in which every edge is shared by exactly two, running
// opposite ways, which nowhere cross each other, and which enclose a positive volume. From outside such a solid its
// back faces can never be seen, so they need not be drawn, and of the rays that start there all that enter it leave it,
// so that it buries nothing. A plain value.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace radiosity::scene {

struct ClosedSolids {
  struct Bounds {
    glm::vec3 low, high;
  };
  std::vector<std::uint32_t> solid_of;  ///< by triangle; kNone: not part of a closed solid
  std::vector<Bounds> bounds;           ///< by solid
  /// Connected triangles that are no closed solid and yet hold something: legs of chairs that have no ends. One may
  /// look out of them. By triangle: which, or kNone; and by these.
  std::vector<std::uint32_t> hollow_of;
  std::vector<Bounds> hollows;
};

}  // namespace radiosity::scene
