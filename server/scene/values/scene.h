// The scene as plain values, imported from a glTF document: what the chart builder, the exporter and the snapshot
// renderer read. No GL, no sockets, no JSON. Immutable once built; shared between threads by const pointer.
#pragma once

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "common/shared_list.h"
#include "server/scene/values/light_web.h"
#include "server/scene/values/sky_picture.h"

namespace radiosity::scene {

inline constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

/// Decoded image, 8 bits a channel, RGBA, row 0 at v = 0 (glTF convention: top row first).
struct Texture {
  int width = 0;
  int height = 0;
  bool srgb = true;  ///< colour textures are sRGB-encoded; convert to linear before use
  std::vector<std::uint8_t> rgba;

  bool operator==(const Texture&) const = default;
};

/// A texture as a material refers to it: which image, which TEXCOORD set, KHR_texture_transform already combined.
struct TextureUse {
  std::uint32_t texture = kNone;
  int texcoord = 0;
  glm::vec2 offset{0.0F};
  glm::vec2 scale{1.0F};
  float rotation = 0.0F;
  bool repeat_u = true, repeat_v = true;  ///< false: clamp (mirror is treated as repeat with mirrored flag)
  bool mirror_u = false, mirror_v = false;
  bool nearest = false;  ///< magFilter NEAREST: a texel's colour holds over the whole texel

  bool operator==(const TextureUse&) const = default;
};

enum class AlphaMode { kOpaque, kMask, kBlend };

struct Material {
  std::string name;
  glm::vec3 base_color{1.0F};  ///< linear sRGB factor
  float alpha = 1.0F;
  float alpha_cutoff = 0.5F;
  float metallic = 0.0F;        ///< reflectance = base_color x (1 - metallic) x (1 - the largest channel of specular)
  glm::vec3 specular{0.0F};     ///< KHR_materials_pbrSpecularGlossiness, linear; 0 elsewhere
  float roughness = 1.0F;       ///< GGX: its square is the width of the slopes of microfacets; 0: a perfect mirror
  float ior = 1.5F;             ///< KHR_materials_ior; of what is no metal
  float transmission = 0.0F;    ///< KHR_materials_transmission factor
  glm::vec3 attenuation{1.0F};  ///< KHR_materials_volume: of light that passes its thickness, this part is left
  glm::vec3 emission{0.0F};     ///< L_e in nits: emissiveFactor x emissiveStrength
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  bool double_sided = false;
  TextureUse base_color_texture, emissive_texture;
  TextureUse metallic_texture;      ///< its blue channel multiplies `metallic`
  TextureUse roughness_texture;     ///< its green channel multiplies `roughness`; of metal alone
  TextureUse specular_texture;      ///< RGB multiplies `specular`
  TextureUse transmission_texture;  ///< its red channel multiplies `transmission`
  /// KHR_materials_diffuse_transmission: of the light that is not reflected specularly the part that leaves diffusely
  /// on the other side, and its colour, linear. Above 0: `double_sided`.
  float diffuse_transmission = 0.0F;
  glm::vec3 diffuse_transmission_color{1.0F};
  TextureUse diffuse_transmission_texture;        ///< its alpha channel multiplies `diffuse_transmission`
  TextureUse diffuse_transmission_color_texture;  ///< RGB multiplies `diffuse_transmission_color`

  /// Paper, a leaf, a lampshade: light that arrives on one side leaves on both.
  [[nodiscard]] bool isTranslucent() const { return diffuse_transmission > 0.0F; }

  bool operator==(const Material&) const = default;
};

/// One glTF primitive as a triangle list in mesh space. All per-vertex arrays are empty or positions.size() long.
struct Primitive {
  std::uint32_t mesh = kNone;       ///< index into /meshes
  std::uint32_t primitive = kNone;  ///< index into /meshes/<mesh>/primitives
  std::uint32_t material = 0;  ///< index into Scene::materials (a default material is appended where none is named)
  std::vector<glm::dvec3> positions;
  std::vector<glm::vec3> normals;  ///< unit length, or 0 where the file's is unusable; empty: flat, as glTF says
  std::vector<glm::vec2> texcoord0, texcoord1;
  std::vector<glm::vec4> color0;       ///< linear
  std::vector<std::uint32_t> indices;  ///< 3 a triangle, counter-clockwise = front, all < positions.size()
  bool posed = false;                  ///< joints or morph targets move its vertices, as numbered in the file

  bool operator==(const Primitive&) const = default;
};

/// A primitive placed in the world by a node (or by one element of EXT_mesh_gpu_instancing).
struct Instance {
  std::uint32_t node = kNone;       ///< index into /nodes
  std::uint32_t primitive = kNone;  ///< index into Scene::primitives
  glm::dmat4 world{1.0};            ///< mesh to world, metres; a negative determinant flips the front
  bool visible = true;
  float texel_scale = 1.0F;  ///< texels a metre, relative to the rest of the scene: /nodes/N/extras/radiosityTexelScale

  bool operator==(const Instance&) const = default;
};

struct Camera {
  std::string name;
  glm::dmat4 world{1.0};  ///< camera looks along -Z, Y up
  double yfov_rad = 0.8;
  double aspect = 0.0;  ///< width / height; 0: the picture's own
  double znear = 0.01;
};

enum class LightKind { kPoint, kSpot, kDirectional, kRectangle, kDisc, kWeb };

/// A light that is no surface, in world space: KHR_lights_punctual, EXT_lights_area, EXT_lights_ies.
struct PunctualLight {
  LightKind kind = LightKind::kPoint;
  glm::dvec3 position{0.0};
  glm::dvec3 direction{0.0, 0.0, -1.0};
  /// Colour included. Candela (point, spot), lux (directional), nits (rectangle, disc), or a factor of a web's candela.
  glm::vec3 intensity{0.0F};
  double range = 0.0;  ///< metres; 0: infinite
  double inner_cone_rad = 0.0;
  double outer_cone_rad = 0.785398163;
  glm::dvec3 across{1.0, 0.0, 0.0};  ///< of a rectangle, along its width; of a web, where the azimuth is 0
  /// Metres, of a rectangle's width and height. The first is the radius of a disc, of the ball that a point light is,
  /// and of the disc that a spot is; 0: they have no size. Of a directional light: half of the angle, in radians,
  /// within which its light comes.
  glm::dvec2 half{0.0};
  SharedWeb web = {};

  bool operator==(const PunctualLight&) const = default;
};

/// A sun: light from within a small angle around a direction, evenly.
struct SkySun {
  glm::dvec3 direction{0.0, 1.0, 0.0};  ///< towards it, unit length
  glm::vec3 illuminance{0.0F};          ///< lux, on a plane that faces it
  double diameter_rad = 0.0;            ///< as it is seen; 0: all from one direction

  bool operator==(const SkySun&) const = default;
};

/// Radiance of everything outside the scene, nits, the sum of: one colour above the horizon (+Y) and one below it, a
/// picture, and a sun. Of the colours, without anything in between, a surface whose normal makes the angle theta with
/// +Y receives pi (upper (1 + cos theta) + lower (1 - cos theta)) / 2 lux.
struct Sky {
  glm::vec3 upper{0.0F}, lower{0.0F};
  SharedSkyPicture picture = {};
  float strength = 1.0F;  ///< that the picture is multiplied by
  double turn_rad = 0.0;  ///< of the picture, about +Y: from +Z towards +X
  std::optional<SkySun> sun = std::nullopt;

  bool operator==(const Sky&) const = default;
};

struct Scene {
  SharedList<Texture> textures;
  std::vector<Material> materials;
  SharedList<Primitive> primitives;
  std::vector<Instance> instances;
  std::vector<Camera> cameras;
  std::vector<PunctualLight> lights;
  std::optional<Sky> sky;               ///< /extras/radiositySky, or of an extension
  std::vector<std::string> warnings;    ///< "room.glb: /materials/3: ..." in the order found
  std::uint64_t triangles_dropped = 0;  ///< zero-area, non-finite or duplicate triangles left out
};

}  // namespace radiosity::scene
