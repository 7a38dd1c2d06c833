// Writes a test scene as one GLB file: float positions and normals, flat where polygons have none of their own, one
// node, mesh and material each.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "tests/scenes/scene.h"

namespace radiosity::test_scenes {

[[nodiscard]] std::vector<std::uint8_t> encodeGlb(const TestScene& scene);

/// Throws std::runtime_error when the file cannot be written.
void writeGlb(const TestScene& scene, const std::filesystem::path& file);

}  // namespace radiosity::test_scenes
