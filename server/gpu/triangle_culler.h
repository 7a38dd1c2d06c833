// Decides on the CPU which triangles each hemicube face can see. Tests every triangle with a few dozen vectorised
// operations, far less than the driver needs to find out the same. One thread.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/gpu/closed_solids.h"
#include "server/gpu/hemicube_views.h"
#include "server/scene/patch_scene.h"

namespace radiosity::gpu {

class TriangleCuller {
 public:
  TriangleCuller() = default;
  explicit TriangleCuller(const scene::PatchScene& patches);

  /// Index counts of one face: triangles that lie wholly inside its pyramid, then triangles that cross its border. They
  /// are drawn apart: llvmpipe takes a slow path for a whole draw as soon as one of its triangles must be clipped.
  struct FaceCount {
    std::uint32_t inside = 0, crossing = 0;
  };
  using Counts = std::array<FaceCount, RAD_FACES>;

  /// Appends to `indices` the corners of the triangles that may be seen through each face (inside, then crossing, face
  /// by face, in scene order). Nothing at or below the plane of the shooter is seen, nor the backs of closed solids
  /// whose bounds do not hold the shooter.
  Counts cull(const HemicubeAxes& axes, std::vector<std::uint32_t>& indices);

  /// Whether a triangle's back is hidden from this shooter by the rest of its solid.
  [[nodiscard]] bool backHidden(std::size_t triangle) const {
    return solids_.solid_of[triangle] != scene::kNone && outside_[solids_.solid_of[triangle]] != 0;
  }
  [[nodiscard]] std::size_t triangleCount() const { return triangle_count_; }

 private:
  std::size_t triangle_count_ = 0;
  /// corner_[c][axis][triangle]
  std::array<std::array<std::vector<float>, 3>, 3> corner_;
  std::array<std::vector<float>, 4> plane_;  ///< normal, distance
  ClosedSolids solids_;
  std::vector<std::uint8_t> outside_;  ///< by solid: the shooter is
  std::vector<std::uint32_t> indices_;
  std::vector<std::uint16_t>
      faces_;  ///< bit f: face f may see the triangle; bit 8 + f: it lies inside; bit 7: shows its back
  std::array<std::vector<std::uint32_t>, std::size_t{2} * RAD_FACES> seen_;  ///< face f: 2 f inside, 2 f + 1 crossing
};

}  // namespace radiosity::gpu
