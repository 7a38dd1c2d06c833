// What the path tracer and the lightmap comparison work on: world-space triangles with constant reflectance. Read from
// a GLB by a reader of our own, or taken straight from a generated scene. A value; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "tests/scenes/scene.h"

namespace radiosity::oracle {

struct Triangle {
  std::array<glm::dvec3, 3> corners{};  ///< metres, counter-clockwise = front
  glm::dvec3 normal{0.0};               ///< unit, front
  glm::dvec3 reflectance{0.0};
  glm::dvec3 emission_lux{0.0};  ///< radiosity E = pi x luminance
  bool double_sided = false;
  std::array<glm::dvec2, 3> lightmap_uv{};  ///< TEXCOORD_1
  int lightmap_page = -1;                   ///< extras.lightmap of the primitive; -1: none
  std::uint32_t node = 0, material = 0;
};

struct TriangleScene {
  std::vector<Triangle> triangles;  ///< none of zero area
  std::vector<std::string> node_names;
  std::vector<std::string> warnings;  ///< what the reader does not model (textures, blending), named
};

[[nodiscard]] double area(const Triangle& triangle);

[[nodiscard]] TriangleScene triangulate(const test_scenes::TestScene& scene);

/// Reads a GLB (one BIN chunk). Throws std::runtime_error with the reason.
[[nodiscard]] TriangleScene readGlb(const std::filesystem::path& file);

}  // namespace radiosity::oracle
