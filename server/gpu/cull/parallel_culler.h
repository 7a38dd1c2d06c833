// Decides on the CPU which triangles an image in parallel projection must show: not those that lie between the samples
// of its pixels, nor backs of closed solids. The image is that of all triangles. One thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/values/patch_scene.h"

namespace radiosity::gpu {

/// Unit box to the image of one view: pixel = floor(across (p - centre) + shift), in columns and rows.
struct ParallelAxes {
  glm::vec3 centre, right, up;  ///< right and up: pixels for each unit
  glm::vec2 shift;
  double pixel_area;  ///< unit^2
};

class ParallelCuller {
 public:
  ParallelCuller() = default;
  explicit ParallelCuller(const scene::PatchScene& patches);

  /// Appends the corners of the triangles to draw, in scene order. `direction`: unit, towards the light. The view's
  /// image must hold the whole scene.
  void select(const ParallelAxes& axes, const glm::vec3& direction, std::vector<std::uint32_t>& indices);
  [[nodiscard]] std::size_t triangleCount() const { return skipped_.size(); }

 private:
  std::array<std::array<std::vector<float>, 3>, 3> corner_;  ///< [corner][axis][triangle]
  std::array<std::vector<float>, 3> solid_normal_;           ///< of triangles of closed solids; zero: of no solid
  std::vector<std::uint32_t> indices_;
  std::vector<std::uint32_t> skipped_;  ///< by triangle: what the kernel found
};

}  // namespace radiosity::gpu
