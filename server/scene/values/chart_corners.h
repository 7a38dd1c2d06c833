// A triangle of a chart with the vertices of the primitive it came from: attributes as affine functions of texel
// coordinates. Pure functions, any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/matrix.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

struct ChartCorners {
  std::array<glm::dvec2, 3> texel;      ///< chart coordinates
  std::array<std::uint32_t, 3> vertex;  ///< of the primitive
  double inverse_area;                  ///< of twice the triangle in texels; 0: it has none

  /// Barycentric weights at a place of the chart.
  [[nodiscard]] glm::vec3 weightsAt(const glm::dvec2& p) const {
    const auto cross = [](const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; };
    const double w1 = cross(p - texel[0], texel[2] - texel[0]) * inverse_area;
    const double w2 = cross(texel[1] - texel[0], p - texel[0]) * inverse_area;
    return {1.0 - w1 - w2, w1, w2};
  }
};

[[nodiscard]] inline ChartCorners cornersOf(const PatchScene& patches, std::uint32_t triangle, const Instance& instance,
                                            const Primitive& primitive) {
  ChartCorners corners{};
  const bool flipped = patches.surfaces[patches.triangle_surface[triangle]].flipped;
  const bool reversed = (glm::determinant(glm::dmat3(instance.world)) < 0.0) != flipped;
  const std::size_t source = std::size_t{3} * patches.triangle_source[triangle];
  for (std::size_t k = 0; k < 3; ++k) {
    corners.texel[k] = glm::dvec2(patches.vertices[patches.indices[std::size_t{3} * triangle + k]].texel);
    corners.vertex[k] = primitive.indices[source + (reversed ? (3 - k) % 3 : k)];
  }
  const glm::dvec2 a = corners.texel[1] - corners.texel[0], b = corners.texel[2] - corners.texel[0];
  const double twice = a.x * b.y - a.y * b.x;
  corners.inverse_area = twice != 0.0 ? 1.0 / twice : 0.0;
  return corners;
}

}  // namespace radiosity::scene
