// A test scene as plain numbers: what the generators make, what the GLB writer writes and what the oracles consume.
// Knows nothing of the server. A value; any thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

namespace radiosity::test_scenes {

struct Material {
  std::string name;
  glm::dvec3 reflectance{0.0};    ///< linear sRGB, each channel in [0, 1)
  glm::dvec3 emission_nits{0.0};  ///< luminance of the front side
  double opacity = 1.0;           ///< below 1: alphaMode BLEND
  bool double_sided = false;
  double metallic = 0.0, roughness = 1.0;
  double transmission = 0.0;          ///< above 0: glass, of which `reflectance` is the tint
  double diffuse_transmission = 0.0;  ///< KHR_materials_diffuse_transmission: its factor, and its colour
  glm::dvec3 transmitted{1.0};
};

/// Convex, planar, counter-clockwise seen from the side that reflects and emits.
struct Polygon {
  std::vector<glm::dvec3> corners;  ///< world space, metres
  std::uint32_t material = 0;
  std::vector<glm::dvec3> normals = {};  ///< of the corners, unit length; empty: flat
};

/// Becomes one glTF node and mesh; `origin` is the node's translation, so that moving the node moves the thing.
struct Object {
  std::string name;
  glm::dvec3 origin{0.0};
  std::vector<Polygon> polygons;
};

/// KHR_lights_punctual, or EXT_lights_area.
struct Light {
  enum class Kind { kPoint, kSpot, kDirectional, kRectangle, kDisc } kind = Kind::kPoint;
  glm::dvec3 position{0.0};
  glm::dvec3 target{0.0, -1.0, 0.0};  ///< all but points: shines this way from `position`
  glm::dvec3 intensity{1.0};          ///< candela; lux of a directional light; nits of a rectangle or disc
  double range_m = 0.0;               ///< 0: none
  double inner_cone_rad = 0.0, outer_cone_rad = 0.7853981633974483;
  double radius_m = 0.0;                 ///< of a disc; extras.radiosityRadius of a point or spot
  double width_m = 0.0, height_m = 0.0;  ///< of a rectangle: across is at right angles to +Y
  double angle_deg = 0.0;                ///< extras.radiosityAngle of a directional light
};

struct Camera {
  glm::dvec3 position{0.0};
  glm::dvec3 target{0.0, 0.0, -1.0};
  double yfov_rad = 0.8;
  double aspect = 0.0;  ///< width / height; 0: the picture's own
};

struct TestScene {
  std::string name;
  std::vector<Material> materials;
  std::vector<Object> objects;
  std::vector<Light> lights;
  glm::dvec3 sky_upper_nits{0.0}, sky_lower_nits{0.0};  ///< written as /extras/radiositySky where not black
  Camera camera;

  /// Adds a material and returns its index.
  std::uint32_t add(Material material);
  [[nodiscard]] std::size_t polygonCount() const;
};

/// Sum of the normals of a fan of triangles, each twice its area long; not a unit vector.
[[nodiscard]] glm::dvec3 polygonNormal(const Polygon& polygon);
[[nodiscard]] double polygonArea(const Polygon& polygon);

}  // namespace radiosity::test_scenes
