// All ways from a place to a convex polygon, and points on that: what RayTree::hide() looks into. Plain values.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

namespace radiosity::scene {

struct Shaft {
  static constexpr std::size_t kMostSides = 8;

  /// `from`, of that unit `normal`, lies before the polygon, whose unit normal `of_end` points to where it is seen
  /// from. What comes no nearer than `spare` to ways that begin before the place and end before the polygon is outside.
  Shaft(const glm::vec3& from, const glm::vec3& normal, std::span<const glm::vec3> corners, const glm::vec3& of_end,
        float spare);

  glm::vec3 from;
  float length = 0.0F;                          ///< of its longest edge
  std::array<glm::vec4, kMostSides + 2> plane;  ///< inside: dot(normal, x) + w > 0; unit normals
  std::size_t count = 0;
};

/// Points of an end, a multiple of eight of them.
struct ShaftPoints {
  std::vector<float> x, y, z;
};

}  // namespace radiosity::scene
