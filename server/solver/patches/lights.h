// Emissive surfaces as convex polygons, for gathered direct light.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <vector>

#include "server/solver/patches/side.h"

namespace radiosity::solver {

/// A convex planar polygon of uniform emission: a quad where two triangles make one, else a triangle.
struct LightPolygon {
  std::array<glm::vec3, 4> corners{};
  std::uint32_t corner_count = 3;
  glm::vec3 normal{0.0F};    ///< towards the lit side
  glm::vec3 emission{0.0F};  ///< exitance, lm/m^2
  double area = 0.0;         ///< unit box squared
  std::uint32_t key = 0;     ///< 2 (Side::triangle_key + triangle) + side: stable across edits

  /// Around its corners, about their middle; w: the radius.
  [[nodiscard]] glm::vec4 ball() const;
  /// The point at (u, v) in [0, 1)^2, uniform in area. On a parallelogram u and v go along its edges: by two triangles
  /// the square of the error at the edges of shadows is 2.4 times as large.
  [[nodiscard]] glm::vec3 point(double u, double v) const;
};

/// Up to rounding.
[[nodiscard]] bool isParallelogram(std::span<const glm::vec3> corners);

/// Emissive planar surfaces of few polygons and uniform emission, of which nothing is hidden, become light polygons,
/// and their sides are marked `gathered`; the emission of all others is shot like reflected light: of a lamp that
/// something covers in part, or that stands in a solid, leaves know how much shines.
[[nodiscard]] std::vector<LightPolygon> findLightPolygons(const scene::PatchScene& patches, std::vector<Side>& sides,
                                                          const scene::SideColours& emission);

}  // namespace radiosity::solver
