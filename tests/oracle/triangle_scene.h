// What the path tracer and the lightmap comparison work on: world-space triangles with constant reflectance. Read from
// a GLB by a reader of our own, or taken straight from a generated scene. A value; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "tests/scenes/scene.h"

namespace radiosity::oracle {

/// Base colour and alpha, nearest pixel, repeated.
struct Texture {
  int width = 0, height = 0;
  std::vector<std::uint8_t> rgba;  ///< sRGB, row 0 = v 0

  [[nodiscard]] glm::dvec4 at(const glm::dvec2& uv) const;  ///< linear, alpha in w
};

/// A light without extent, world space.
struct Lamp {
  enum class Kind { kPoint, kSpot, kSun } kind = Kind::kPoint;
  glm::dvec3 position{0.0};
  glm::dvec3 direction{0.0, 0.0, -1.0};  ///< unit, in which the light goes
  glm::dvec3 intensity{0.0};             ///< candela; lux of a sun
  double range = 0.0;                    ///< metres; 0: none
  double inner_rad = 0.0, outer_rad = 0.7853981633974483;
};

struct Triangle {
  std::array<glm::dvec3, 3> corners{};  ///< metres, counter-clockwise = front
  glm::dvec3 normal{0.0};               ///< unit, front
  glm::dvec3 reflectance{0.0};
  glm::dvec3 emission_lux{0.0};  ///< radiosity E = pi x luminance
  bool double_sided = false;
  std::array<glm::dvec2, 3> lightmap_uv{};  ///< TEXCOORD_1
  int lightmap_page = -1;                   ///< extras.lightmap of the primitive; -1: none
  int texture = -1;                         ///< into TriangleScene::textures; -1: none
  std::array<glm::dvec2, 3> texture_uv{};   ///< of the texture, which multiplies reflectance and alpha
  bool see_through = false;                 ///< masked, blended or transmitting
  double alpha = 1.0;
  double cutoff = -1.0;  ///< alpha mask; below 0: blended
  double transmission = 0.0;
  std::uint32_t node = 0, material = 0;
};

struct TriangleScene {
  std::vector<Triangle> triangles;  ///< none of zero area
  std::vector<Texture> textures;
  std::vector<Lamp> lamps;
  glm::dvec3 sky_upper{0.0}, sky_lower{0.0};  ///< radiance from above and from below the horizon (+Y), nits
  bool has_sky = false;                       ///< the file names one, be it black
  std::vector<std::string> node_names;
  std::vector<std::string> warnings;  ///< what the reader does not model (textures, blending), named
};

[[nodiscard]] double area(const Triangle& triangle);

[[nodiscard]] TriangleScene triangulate(const test_scenes::TestScene& scene);

/// Reads a GLB (one BIN chunk). Throws std::runtime_error with the reason.
[[nodiscard]] TriangleScene readGlb(const std::filesystem::path& file);

}  // namespace radiosity::oracle
