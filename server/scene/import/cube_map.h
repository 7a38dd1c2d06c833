// A sky on the six faces of a cube, and as a picture. Plain values; any thread.
#pragma once

#include <array>
#include <cstddef>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <string>
#include <vector>

#include "common/bytes.h"
#include "common/result.h"
#include "server/scene/values/sky_picture.h"

namespace radiosity::scene {

/// In the order and orientation of KTX and OpenGL: +X, -X, +Y, -Y, +Z, -Z; each seen from within, row 0 at the top.
struct CubeMap {
  std::size_t size = 0;                         ///< of an edge
  std::array<std::vector<glm::vec3>, 6> faces;  ///< nits, size times size each

  /// Interpolated within a face; `direction` of any length but 0.
  [[nodiscard]] glm::vec3 radiance(const glm::dvec3& direction) const;
};

/// Edges of cubes that are larger are refused.
inline constexpr std::size_t kMostCubeEdge = 4096;

/// As wide as four of its faces, where an image may be. `rotation`: of the cube in the scene. Cost: of its texels.
[[nodiscard]] SkyImage imageOfCube(const CubeMap& cube, const glm::dquat& rotation);

/// Of a KTX 2.0 file, its largest mip level and one layer: floats of 16 or 32 bits, shared exponents (E5B9G9R9), or 8
/// bits, not compressed. kUnsupported for other formats; kInvalidScene; kTooLarge.
[[nodiscard]] Result<CubeMap> readKtx2Cube(const Bytes& bytes, std::size_t layer, const std::string& where);

}  // namespace radiosity::scene
