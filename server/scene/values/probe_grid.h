// Grids of light probes: places in space at which the light is told that arrives from all directions. Plain values; any
// thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <limits>
#include <string>

#include "common/result.h"

namespace radiosity::scene {

inline constexpr std::size_t kMostProbeGrids = 64;
/// Of all grids of a scene together.
inline constexpr std::uint64_t kMostProbes = std::uint64_t{1} << 18U;

/// A box in the world, metres, and the probes in the middle of its cells: /nodes/N/extras/radiosityProbes, or the whole
/// scene.
struct ProbeGrid {
  static constexpr std::uint32_t kWholeScene = std::numeric_limits<std::uint32_t>::max();

  std::uint32_t node = kWholeScene;
  std::string name;  ///< of the node; may be empty
  glm::dvec3 corner{0.0};
  std::array<glm::dvec3, 3> sides{};  ///< of the box
  std::array<std::uint32_t, 3> counts{1, 1, 1};

  [[nodiscard]] std::uint64_t probeCount() const { return std::uint64_t{counts[0]} * counts[1] * counts[2]; }
  [[nodiscard]] glm::dvec3 step(std::size_t axis) const { return sides[axis] / static_cast<double>(counts[axis]); }
  [[nodiscard]] glm::dvec3 first() const { return corner + 0.5 * (step(0) + step(1) + step(2)); }
  bool operator==(const ProbeGrid&) const = default;
};

/// Divides the sides of a grid into as few cells as are no wider than `spacing` (metres, above 0). kTooLarge, which
/// says how many probes that makes, and which spacing would do, where these and `others` are more than kMostProbes.
[[nodiscard]] Result<void> divide(ProbeGrid& grid, double spacing, std::uint64_t others);

}  // namespace radiosity::scene
