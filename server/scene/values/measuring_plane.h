// Measuring planes of lighting design: rectangles at whose points the illuminance is told. Light passes through them.
// Plain values; any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <string>

namespace radiosity::scene {

inline constexpr std::size_t kMostPlanes = 64;
/// Of all planes of a scene together.
inline constexpr std::uint64_t kMostPlanePoints = 250'000;

/// What a plane is to reach: EN 12464-1 asks for a mean illuminance and for a uniformity.
struct PlaneTarget {
  std::optional<double> lux;         ///< the mean at least
  std::optional<double> uniformity;  ///< U0, the minimum divided by the mean, at least

  bool operator==(const PlaneTarget&) const = default;
};

/// /nodes/N/extras/radiosityPlane, placed in the world, metres. Its points are the centres of columns x rows cells.
struct MeasuringPlane {
  std::uint32_t node = 0;
  std::string name;  ///< of the node; may be empty
  glm::dvec3 corner{0.0};
  glm::dvec3 across{1.0, 0.0, 0.0}, down{0.0, 0.0, 1.0};  ///< both sides, along columns and along rows
  glm::dvec3 normal{0.0, 1.0, 0.0};                       ///< unit length: light from this side counts
  std::uint32_t columns = 1, rows = 1;
  PlaneTarget target;

  [[nodiscard]] std::uint64_t pointCount() const { return std::uint64_t{columns} * rows; }
  [[nodiscard]] glm::dvec3 pointAt(std::uint32_t column, std::uint32_t row) const {
    return corner + (column + 0.5) / columns * across + (row + 0.5) / rows * down;
  }
  bool operator==(const MeasuringPlane&) const = default;
};

struct PlaneGrid {
  std::uint64_t columns = 1, rows = 1;
};
/// EN 12464-1:2021, 4.4: cells of about p = 0.2 * 5^log10(d) metres, 10 at most, where d is the longer side, or the
/// shorter one where the other is at least twice as long; d / p is rounded to a whole number, and cells are nearly
/// square. Both sides above 0, metres.
[[nodiscard]] PlaneGrid usualGrid(double width, double depth);

}  // namespace radiosity::scene
