// Normals that a file gives for the corners of triangles, where they are not the triangles' own: curved things of few
// facets are to look smooth. Light is carried between triangles as they are; only what is told of it is for the
// interpolated normal. Immutable; any thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

class ShadingNormals {
 public:
  /// All are flat.
  ShadingNormals() = default;
  /// `patches`: built from `scene`. O(triangles); where all are flat nothing is kept.
  ShadingNormals(const Scene& scene, const PatchScene& patches);

  [[nodiscard]] bool empty() const { return of_triangle_.empty(); }
  /// Whether the triangle of the patch scene has normals of its corners.
  [[nodiscard]] bool has(std::uint32_t triangle) const { return !empty() && of_triangle_[triangle] != kNone; }
  /// Of the front, unit length, at texel coordinates of its chart; beside the triangle that of its nearest edge.
  /// `geometric`: the triangle's own, which it is wherever the interpolated one points to the other side.
  [[nodiscard]] glm::dvec3 at(std::uint32_t triangle, const glm::vec2& texel, const glm::dvec3& geometric) const;

 private:
  /// Weights of the second and third corner are (texel - origin) dot these.
  struct Corners {
    glm::vec2 origin, second, third;
    std::array<glm::vec3, 3> normal;
  };
  std::vector<std::uint32_t> of_triangle_;  ///< into corners_, or kNone; empty: all are flat
  std::vector<Corners> corners_;
};

}  // namespace radiosity::scene
