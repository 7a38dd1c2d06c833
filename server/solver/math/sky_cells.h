// The sky in cells, by which rays remember where they left the scene: about two degrees wide, all of nearly the same
// solid angle, and none across the horizon. Pure functions; any thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>

namespace radiosity::solver {

class SkyCells {
 public:
  /// Of either hemisphere, from the horizon to its middle, each of the same angle.
  static constexpr std::uint32_t kRows = 48;
  /// Of a hemisphere; those above the horizon come first.
  static constexpr std::uint32_t kHalf = 5869;
  static constexpr std::uint32_t kCount = 2 * kHalf;

  /// In which a direction (unit length) lies; what is level counts as above.
  [[nodiscard]] static std::uint32_t of(const glm::dvec3& direction);
  [[nodiscard]] static bool isAbove(std::uint32_t cell) { return cell < kHalf; }

  /// Azimuths (atan2(z, x), radians) and heights (y) of a cell, from the least on.
  struct Extent {
    double azimuth = 0.0, width = 0.0, height = 0.0, extent = 0.0;
    [[nodiscard]] double solidAngle() const { return width * extent; }
  };
  [[nodiscard]] static Extent extentOf(std::uint32_t cell);
  /// Of its middle, unit length.
  [[nodiscard]] static glm::dvec3 directionOf(std::uint32_t cell);
};

}  // namespace radiosity::solver
