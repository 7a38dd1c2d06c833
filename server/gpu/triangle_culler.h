// Decides on the CPU which triangles each hemicube face can see. Tests every triangle with a few dozen vectorised
// operations, far less than the driver needs to find out the same. One thread.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/gpu/hemicube_views.h"
#include "server/scene/patch_scene.h"

namespace radiosity::gpu {

class TriangleCuller {
 public:
  TriangleCuller() = default;
  explicit TriangleCuller(const scene::PatchScene& patches);

  /// Appends to `indices` the corners of the triangles that may be seen through each face, in scene order, and returns
  /// how many indices each face got. Nothing at or below the plane of the shooter is seen.
  std::array<std::uint32_t, RAD_FACES> cull(const HemicubeAxes& axes, std::vector<std::uint32_t>& indices);

  [[nodiscard]] std::size_t triangleCount() const { return triangle_count_; }

 private:
  std::size_t triangle_count_ = 0;
  /// corner_[c][axis][triangle]
  std::array<std::array<std::vector<float>, 3>, 3> corner_;
  std::vector<std::uint32_t> indices_;
  std::vector<std::uint8_t> faces_;  ///< bit f: face f may see the triangle
  std::array<std::vector<std::uint32_t>, RAD_FACES> seen_;
};

}  // namespace radiosity::gpu
