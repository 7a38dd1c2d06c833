// A picture of the sky as the oracle has it: radiance by direction, and directions drawn by it. Plain values.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace radiosity::oracle {

/// Equirectangular; row 0 around +Y, the middle column towards +X and those to its right by way of +Z.
struct SkyMap {
  std::size_t width = 0, height = 0;
  std::vector<glm::dvec3> nits;  ///< of each texel all over
  double turn_rad = 0.0;         ///< of the picture about +Y, from +Z towards +X

  [[nodiscard]] bool empty() const { return nits.empty(); }
  [[nodiscard]] glm::dvec3 radiance(const glm::dvec3& direction) const;
  /// Probability per steradian of draw().
  [[nodiscard]] double density(const glm::dvec3& direction) const;
  /// Unit length; u and v uniform in [0, 1).
  [[nodiscard]] glm::dvec3 draw(double u, double v) const;
  /// To be called before density() and draw().
  void prepare();

 private:
  [[nodiscard]] std::size_t texelAt(const glm::dvec3& direction) const;
  [[nodiscard]] double solidAngle(std::size_t row) const;
  std::vector<double> cumulative_;  ///< by texel: of the sum of all channels times solid angle
};

/// A Radiance HDR file, each number times `strength`. Throws std::runtime_error.
[[nodiscard]] SkyMap readSkyMap(std::span<const char> bytes, double strength, double turn_rad);

}  // namespace radiosity::oracle
