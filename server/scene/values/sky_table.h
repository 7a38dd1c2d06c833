// Where the light of a sky comes from, as a table that is one list of floats, so that it travels to the renderers as it
// is: rectangles of the sky with the part of its light that each sends. Plain values; any thread.
//
// Directions are told by azimuth, atan2(z, x) in radians, and height, which is their y. Areas of (azimuth, height) are
// solid angles.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace radiosity::scene {

/// A sky is cut into so many rectangles at most, smaller where its light varies more.
inline constexpr std::size_t kMostSkyRectangles = 4096;

/// Strengths of directions, width times height of them, row by row from the zenith; columns by azimuth from -pi.
struct SkyGrid {
  std::size_t width = 0, height = 0;
  std::vector<float> strength;  ///< finite, none below 0
};

/// A table: the number of rectangles (1 at least); the mean direction of the light, three numbers, shorter the more the
/// light is spread; then, of all rectangles in turn, the sum of light up to and with each (1 at the end), their least
/// azimuths, widths, least heights and extents of these. Empty where no strength is above 0. O(n log n).
[[nodiscard]] std::vector<float> skyTable(const SkyGrid& grid);

/// Whether it is a table that may be drawn from: its count fits its length, and its sums ascend to 1. O(n).
[[nodiscard]] bool isSkyTable(std::span<const float> table);

/// Of a table: three of its numbers.
[[nodiscard]] glm::dvec3 meanSkyDirection(std::span<const float> table);

/// Unit length; drawn in proportion to the light, uniform in each rectangle. `at`: uniform in [0, 1)^2. Cost: a binary
/// search.
[[nodiscard]] glm::dvec3 skyDirection(std::span<const float> table, const glm::dvec2& at);

/// 64 bits of floats, the same for the same ones (FNV-1a, by words).
[[nodiscard]] std::uint64_t keyOfFloats(std::span<const float> values);

}  // namespace radiosity::scene
