// A sky on the six faces of a cube, and as a picture. Plain values; any thread.
#pragma once

#include <array>
#include <cstddef>
#include <glm/gtc/quaternion.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/bytes.h"
#include "common/result.h"
#include "server/scene/values/sky_picture.h"

namespace radiosity::scene {

/// In the order and orientation of KTX and OpenGL: +X, -X, +Y, -Y, +Z, -Z; each seen from within, row 0 at the top.
struct CubeMap {
  std::size_t size = 0;                         ///< of an edge
  std::array<std::vector<glm::vec3>, 6> faces;  ///< nits, size times size each; finite, none below 0

  /// Of the texel that lies there; `direction` of any length but 0.
  [[nodiscard]] glm::vec3 radiance(const glm::dvec3& direction) const;
};

/// Of a number of sRGB, 0 to 1.
[[nodiscard]] float linearOf(float encoded);

/// Edges of cubes that are larger are refused.
inline constexpr std::size_t kMostCubeEdge = 4096;

/// Makes a face of rows that come one by one, so that one of any size takes no more memory than it is reduced to: an
/// image has no more columns than four such faces. Texels are means over solid angles.
class CubeFaceMaker {
 public:
  static constexpr std::size_t kMostSize = SkyImageMaker::kMostWidth / 4;
  /// Of a face whose edge has so many texels, above 0.
  explicit CubeFaceMaker(std::size_t edge);
  /// Texels of an edge of what is made.
  [[nodiscard]] std::size_t size() const { return size_; }
  /// The next row from the top; `edge` of them.
  void addRow(std::span<const glm::vec3> row);
  /// After the last row.
  [[nodiscard]] std::vector<glm::vec3> take() { return std::move(texels_); }

 private:
  void finishRow();

  std::size_t edge_, size_, next_ = 0;
  std::vector<glm::vec3> texels_;
  std::vector<glm::dvec4> across_, sums_;  ///< a row; of the row that is being made: light, and solid angle
};

/// As wide as four of its faces, where an image may be. `rotation`: of the cube in the scene. Light stays what it is to
/// a few hundredths of a single bright texel's. Cost: half a second for the largest, some seconds where it is noise.
[[nodiscard]] SkyImage imageOfCube(const CubeMap& cube, const glm::dquat& rotation);

/// Of a KTX 2.0 file, its largest mip level and one layer: floats of 10, 11, 16 or 32 bits, shared exponents
/// (E5B9G9R9), or 8 bits, not compressed; reduced as CubeFaceMaker does. kUnsupported: other formats, and edges above
/// kMostCubeEdge; kInvalidScene.
[[nodiscard]] Result<CubeMap> readKtx2Cube(const Bytes& bytes, std::size_t layer, const std::string& where);

}  // namespace radiosity::scene
