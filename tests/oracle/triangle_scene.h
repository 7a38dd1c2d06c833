// What the path tracer and the lightmap comparison work on: world-space triangles with what they reflect and emit. Read
// from a glTF file by a reader of our own, or taken straight from a generated scene. A value; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <string>
#include <vector>

#include "tests/oracle/sky.h"
#include "tests/oracle/texture.h"
#include "tests/scenes/scene.h"

namespace radiosity::oracle {

inline constexpr std::uint32_t kNoTriangle = ~std::uint32_t{0};

/// A light that is no surface, world space.
struct Lamp {
  enum class Kind { kPoint, kSpot, kSun, kRectangle, kDisc } kind = Kind::kPoint;
  glm::dvec3 position{0.0};
  glm::dvec3 direction{0.0, 0.0, -1.0};  ///< unit, in which the light goes
  glm::dvec3 intensity{0.0};             ///< candela; lux of a sun; nits of a rectangle or disc
  double range = 0.0;                    ///< metres; 0: none
  double inner_rad = 0.0, outer_rad = 0.7853981633974483;
  double radius = 0.0;                  ///< metres; of a disc, of the ball that a point is, of a spot's disc
  glm::dvec3 half_u{0.0}, half_v{0.0};  ///< metres; of a rectangle, from its middle
};

/// A texture where one triangle uses it.
struct TextureUse {
  int texture = -1;  ///< into TriangleScene::textures; -1: none, which stands for white
  std::array<glm::dvec2, 3> uv{};
};

/// What a surface reflects as a mirror does, or lets through as a thin sheet of glass does.
struct Mirror {
  double metallic = 0.0;        ///< as the file has it; `Triangle::metal` multiplies it by place
  glm::dvec3 colour{0.0};       ///< of metal, and of what glass lets through; texture and varying colours multiply it
  double interface = 0.0;       ///< of glass: reflectance of one interface, of light straight at it; 0: it is none
  double roughness = 1.0;       ///< its square is the width of the slopes
  glm::dvec3 attenuation{1.0};  ///< of light through a face of glass
};

struct Triangle {
  std::array<glm::dvec3, 3> corners{};  ///< metres, counter-clockwise = front
  glm::dvec3 normal{0.0};               ///< unit, front
  std::array<glm::dvec3, 3> shading{};  ///< unit: NORMAL; 0 where it is absent or unusable: as `normal`
  glm::dvec3 reflectance{0.0};          ///< what textures, varying colours and metal by place multiply
  glm::dvec3 emission_lux{0.0};         ///< radiosity E = pi x luminance; its texture multiplies it
  bool double_sided = false;
  std::array<glm::dvec2, 3> lightmap_uv{};  ///< TEXCOORD_1
  int lightmap_page = -1;                   ///< extras.lightmap of the primitive; -1: none
  TextureUse base_colour;                   ///< multiplies reflectance and alpha
  TextureUse emissive;
  double metallic = 0.0;     ///< reflectance loses this part times the blue of `metal`; 0 where `reflectance` has it
  TextureUse metal;          ///< metallicRoughness
  glm::dvec3 specular{0.0};  ///< reflectance loses the largest channel of this times `specular_texture`; 0: likewise
  TextureUse specular_texture;
  bool coloured = false;                ///< its corners differ in COLOR_0
  std::array<glm::dvec4, 3> colours{};  ///< where they do
  bool see_through = false;             ///< masked, blended or transmitting
  double alpha = 1.0;
  double cutoff = -1.0;  ///< alpha mask; below 0: blended
  double transmission = 0.0;
  TextureUse passing;  ///< its red multiplies `transmission`
  Mirror mirror;
  /// KHR_materials_diffuse_transmission: of the light that is not reflected specularly, and its colour. Above 0 light
  /// arrives at, and leaves from, both sides, whatever `double_sided` says.
  double diffuse_transmission = 0.0;
  glm::dvec3 transmitted{0.0};   ///< what textures multiply, the metal's loss included as in `reflectance`
  TextureUse transmission_part;  ///< its alpha multiplies diffuse_transmission
  TextureUse transmission_colour;
  std::uint32_t node = 0, material = 0;
};

struct TriangleScene {
  std::vector<Triangle> triangles;  ///< none of zero area
  std::vector<Texture> textures;
  std::vector<Lamp> lamps;
  glm::dvec3 sky_upper{0.0}, sky_lower{0.0};  ///< radiance from above and from below the horizon (+Y), nits
  SkyMap sky_map;                             ///< to be added; empty: none
  bool has_sky = false;                       ///< the file names one, be it black
  std::vector<std::string> node_names;
  std::vector<std::string> warnings;  ///< what the reader does not model, named
};

[[nodiscard]] double area(const Triangle& triangle);
/// Mirror::interface of a refractive index.
[[nodiscard]] double interfaceOf(double ior);

[[nodiscard]] inline bool hasTwoSides(const Triangle& triangle) {
  return triangle.double_sided || triangle.diffuse_transmission > 0.0;
}

[[nodiscard]] TriangleScene triangulate(const test_scenes::TestScene& scene);

/// Reads a .glb or .gltf with the files that it names. Throws std::runtime_error with the reason.
[[nodiscard]] TriangleScene readGlb(const std::filesystem::path& file);

/// A front and a flipped copy of it, both single-sided and of one material's values, become the double-sided surface
/// that they stand for: in one place a ray would meet either by chance. What has no such twin stays as it is.
[[nodiscard]] TriangleScene joinSides(const TriangleScene& scene);

/// For each single-sided triangle another in the same place that faces the other way; kNoTriangle where there is none.
[[nodiscard]] std::vector<std::uint32_t> flippedTwins(const std::vector<Triangle>& triangles);

/// For each triangle of one scene that of another with the same corners: turned the same way, or else double-sided. Of
/// several in one place the n-th has the n-th. kNoTriangle where there is none.
[[nodiscard]] std::vector<std::uint32_t> matchTriangles(const TriangleScene& of, const TriangleScene& in);

}  // namespace radiosity::oracle
