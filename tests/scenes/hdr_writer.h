// Pictures of skies for tests: Radiance HDR, equirectangular, pixel by pixel.
#pragma once

#include <filesystem>
#include <functional>
#include <glm/vec3.hpp>

namespace radiosity::test_scenes {

/// Radiance in nits of a direction (unit length), in the middle of each pixel: the top row around +Y, the middle column
/// towards +X, those to its right by way of +Z. Numbers are kept to a 256th of the largest of the three. Throws
/// std::runtime_error where the file cannot be written.
void writeHdr(const std::filesystem::path& file, int width, int height,
              const std::function<glm::dvec3(const glm::dvec3&)>& radiance);

}  // namespace radiosity::test_scenes
