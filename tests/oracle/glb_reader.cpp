// A glTF reader of the oracle's own, so that a mistake in the server's importer cannot hide in both: nodes, triangles,
// lamps and the sky. gltf_file.h reads the bytes, gltf_materials.h what surfaces are made of.
#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/matrix.hpp>
#include <glm/vec4.hpp>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>
#include <utility>

#include "tests/oracle/gltf_file.h"
#include "tests/oracle/gltf_materials.h"
#include "tests/oracle/shading.h"
#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {
namespace {

using nlohmann::json;

constexpr int kTriangles = 4, kFan = 6;  // a strip is between them

glm::dmat4 localMatrix(const json& node) {
  glm::dmat4 m(1.0);
  if (node.contains("matrix")) {
    for (int i = 0; i < 16; ++i) m[i / 4][i % 4] = node["matrix"].at(static_cast<std::size_t>(i)).get<double>();
    return m;
  }
  if (node.contains("rotation")) {
    const auto& r = node["rotation"];
    m = glm::mat4_cast(glm::normalize(
        glm::dquat(r.at(3).get<double>(), r.at(0).get<double>(), r.at(1).get<double>(), r.at(2).get<double>())));
  }
  if (node.contains("scale")) {
    const auto scale = vector3(node["scale"]);
    for (int axis = 0; axis < 3; ++axis) m[axis] *= scale[axis];
  }
  if (node.contains("translation")) m[3] = glm::dvec4(vector3(node["translation"]), 1.0);
  return m;
}

/// Three a triangle, whatever the primitive's mode.
std::vector<std::size_t> asList(const std::vector<std::size_t>& indices, int mode) {
  if (mode == kTriangles) return indices;
  std::vector<std::size_t> list;
  for (std::size_t i = 0; i + 2 < indices.size(); ++i) {
    if (mode == kFan) {
      list.insert(list.end(), {indices[i + 1], indices[i + 2], indices[0]});
    } else {
      list.insert(list.end(), {indices[i], indices[i + 1 + i % 2], indices[i + 2 - i % 2]});
    }
  }
  return list;
}

/// What the vertices of a primitive have.
struct Vertices {
  std::vector<glm::dvec3> positions, normals;  ///< world space; normals 0 where unusable
  std::vector<glm::dvec2> lightmap_uvs;
  std::vector<glm::dvec4> colours;
  std::vector<glm::dvec2> base_colour, emissive, metal, specular;  ///< of the textures
  std::vector<glm::dvec2> passing, transmission_part, transmission_colour;
};

class Reader {
 public:
  explicit Reader(const std::filesystem::path& file) : file_(file) {
    for (const auto& extension : file_.member("extensionsRequired")) {
      static const std::vector<std::string> kKnown{"KHR_lights_punctual",
                                                   "EXT_lights_area",
                                                   "KHR_texture_transform",
                                                   "KHR_materials_emissive_strength",
                                                   "KHR_mesh_quantization",
                                                   "KHR_materials_pbrSpecularGlossiness",
                                                   "KHR_materials_diffuse_transmission"};
      if (std::find(kKnown.begin(), kKnown.end(), extension.get<std::string>()) == kKnown.end())
        throw std::runtime_error("requires the extension " + extension.dump());
    }
  }

  TriangleScene read() {
    scene_.textures = readTextures(file_, scene_.warnings);
    materials_ = readMaterials(file_, scene_.warnings);
    readSky();
    for (const auto& node : file_.member("nodes")) scene_.node_names.push_back(node.value("name", ""));
    const auto chosen = file_.json().value("scene", std::size_t{0});
    for (const auto& root : file_.member("scenes").at(chosen).value("nodes", json::array()))
      readNode(root.get<std::uint32_t>(), glm::dmat4(1.0), 0);
    return std::move(scene_);
  }

 private:
  void warn(const std::string& text) {
    if (std::find(scene_.warnings.begin(), scene_.warnings.end(), text) == scene_.warnings.end())
      scene_.warnings.push_back(text);
  }

  void readSky() {
    const auto extras = file_.json().value("extras", json::object());
    if (!extras.is_object() || !extras.contains("radiositySky")) return;
    const auto& sky = extras["radiositySky"];
    if (sky.is_null()) return;
    scene_.has_sky = true;
    if (sky.contains("daylight")) warn("daylight is not modelled: its light is missing");
    if (sky.contains("bufferView"))
      scene_.sky_map = readSkyMap(file_.bytesOfView(sky["bufferView"].get<std::size_t>()), sky.value("strength", 1.0),
                                  sky.value("rotation", 0.0) * std::numbers::pi / 180.0);
    if (!sky.contains("upper")) return;
    scene_.sky_upper = vector3(sky.at("upper"));
    scene_.sky_lower = sky.contains("lower") ? vector3(sky["lower"]) : scene_.sky_upper;
  }

  void readLight(const json& light, const glm::dmat4& world) {
    Lamp lamp;
    const auto type = light.at("type").get<std::string>();
    lamp.kind = type == "point" ? Lamp::Kind::kPoint : type == "spot" ? Lamp::Kind::kSpot : Lamp::Kind::kSun;
    lamp.position = glm::dvec3(world[3]);
    lamp.direction = glm::normalize(-glm::dvec3(world[2]));
    const auto color = light.contains("color") ? vector3(light["color"]) : glm::dvec3(1.0);
    lamp.intensity = color * light.value("intensity", 1.0);
    lamp.range = light.value("range", 0.0);
    if (light.contains("spot")) {
      lamp.inner_rad = light["spot"].value("innerConeAngle", 0.0);
      lamp.outer_rad = light["spot"].value("outerConeAngle", std::numbers::pi / 4);
    }
    lamp.radius = light.value("extras", json::object()).value("radiosityRadius", 0.0);
    scene_.lamps.push_back(lamp);
  }

  /// EXT_lights_area: grows with the largest scale of its node.
  void readAreaLight(const json& light, const glm::dmat4& world) {
    const glm::dvec3 x(world[0]), y(world[1]), z(world[2]);
    const double size = light.value("size", 1.0) * std::max({glm::length(x), glm::length(y), glm::length(z)});
    Lamp lamp;
    lamp.kind = light.at("type") == "disk" ? Lamp::Kind::kDisc : Lamp::Kind::kRectangle;
    lamp.position = glm::dvec3(world[3]);
    lamp.direction = -glm::normalize(z);
    lamp.intensity =
        (light.contains("color") ? vector3(light["color"]) : glm::dvec3(1.0)) * light.value("intensity", 1000.0);
    lamp.radius = 0.5 * size;
    lamp.half_v = 0.5 * size * glm::normalize(y);
    lamp.half_u = 0.5 * size * light.value("rect", json::object()).value("aspect", 1.0) * glm::normalize(x);
    scene_.lamps.push_back(lamp);
  }

  void readNode(std::uint32_t index, const glm::dmat4& parent, int depth) {
    if (depth > 100) throw std::runtime_error("nodes nested too deeply");
    const auto& node = file_.member("nodes").at(index);
    const auto world = parent * localMatrix(node);
    if (node.contains("mesh")) {
      const auto& mesh = file_.member("meshes").at(node["mesh"].get<std::size_t>());
      if (node.contains("skin")) warn("skins are not modelled");
      weights_ = node.value("weights", mesh.value("weights", std::vector<double>()));
      for (const auto& primitive : mesh.at("primitives")) readPrimitive(primitive, world, index);
    }
    const auto extensions = node.value("extensions", json::object());
    if (extensions.contains("KHR_lights_punctual")) {
      const auto& lights = file_.json().at("extensions").at("KHR_lights_punctual").at("lights");
      readLight(lights.at(extensions["KHR_lights_punctual"].at("light").get<std::size_t>()), world);
    }
    if (extensions.contains("EXT_lights_area")) {
      const auto& lights = file_.json().at("extensions").at("EXT_lights_area").at("lights");
      readAreaLight(lights.at(extensions["EXT_lights_area"].at("light").get<std::size_t>()), world);
    }
    for (const auto& child : node.value("children", json::array()))
      readNode(child.get<std::uint32_t>(), world, depth + 1);
  }

  /// Zeros where the primitive lacks the attribute.
  template <typename Vector>
  std::vector<Vector> attribute(const json& attributes, const std::string& name, std::size_t vertices) const {
    std::vector<Vector> values(vertices, Vector(0.0));
    if (!attributes.contains(name)) return values;
    file_.visitAccessor(attributes[name].get<std::size_t>(), static_cast<std::size_t>(Vector::length()),
                        [&](auto i, auto c, double v) { values.at(i)[static_cast<int>(c)] = v; });
    return values;
  }

  std::vector<glm::dvec2> textureUvs(const json& attributes, const MaterialTexture& use, std::size_t vertices) const {
    if (use.texture < 0) return std::vector<glm::dvec2>(vertices, glm::dvec2(0.0));
    auto uvs = attribute<glm::dvec2>(attributes, "TEXCOORD_" + std::to_string(use.texcoord), vertices);
    for (auto& uv : uvs) uv = glm::dvec2(use.transform * glm::dvec3(uv, 1.0));
    return uvs;
  }

  /// The attribute in the pose of the weights: each morph target adds its part.
  std::vector<glm::dvec3> posed(const json& primitive, const std::string& name, std::size_t vertices) const {
    auto values = attribute<glm::dvec3>(primitive.at("attributes"), name, vertices);
    const auto targets = primitive.value("targets", json::array());
    for (std::size_t t = 0; t < std::min(targets.size(), weights_.size()); ++t) {
      const auto moved = attribute<glm::dvec3>(targets[t], name, vertices);
      for (std::size_t i = 0; i < vertices; ++i) values[i] += weights_[t] * moved[i];
    }
    return values;
  }

  Vertices readVertices(const json& primitive, const MaterialValues& material, const glm::dmat4& world) const {
    const auto& attributes = primitive.at("attributes");
    Vertices made;
    const auto count = file_.count(attributes.at("POSITION").get<std::size_t>());
    made.positions = posed(primitive, "POSITION", count);
    for (auto& p : made.positions) p = glm::dvec3(world * glm::dvec4(p, 1.0));
    made.normals = posed(primitive, "NORMAL", count);
    const auto turned = glm::transpose(glm::inverse(glm::dmat3(world)));
    for (auto& n : made.normals) {
      n = turned * n;
      const double length = glm::length(n);
      n = length > 1e-12 && std::isfinite(length) ? n / length : glm::dvec3(0.0);
    }
    made.lightmap_uvs = attribute<glm::dvec2>(attributes, "TEXCOORD_1", count);
    made.base_colour = textureUvs(attributes, material.base_colour, count);
    made.emissive = textureUvs(attributes, material.emissive, count);
    made.metal = textureUvs(attributes, material.metal, count);
    made.specular = textureUvs(attributes, material.specular_texture, count);
    made.passing = textureUvs(attributes, material.passing, count);
    made.transmission_part = textureUvs(attributes, material.transmission_part, count);
    made.transmission_colour = textureUvs(attributes, material.transmission_colour, count);
    made.colours = readColours(attributes, count);
    return made;
  }

  /// Colours multiply reflectance and alpha; integers stand for [0, 1], whether the accessor says so or not.
  std::vector<glm::dvec4> readColours(const json& attributes, std::size_t vertices) const {
    std::vector<glm::dvec4> colours(vertices, glm::dvec4(1.0));
    if (!attributes.contains("COLOR_0")) return colours;
    const auto accessor = attributes["COLOR_0"].get<std::size_t>();
    const auto& description = file_.member("accessors").at(accessor);
    const int type = description.at("componentType").get<int>();
    const bool fractions = description.value("normalized", false);
    const double one = fractions ? 1.0 : type == 5121 ? 255.0 : type == 5123 ? 65535.0 : 1.0;
    file_.visitAccessor(accessor, description.at("type") == "VEC4" ? 4 : 3,
                        [&](auto i, auto c, double v) { colours.at(i)[static_cast<int>(c)] = v / one; });
    return colours;
  }

  std::vector<std::size_t> readIndices(const json& primitive, std::size_t vertices) const {
    std::vector<std::size_t> indices;
    if (primitive.contains("indices")) {
      file_.visitAccessor(primitive["indices"].get<std::size_t>(), 1,
                          [&](auto, auto, double v) { indices.push_back(static_cast<std::size_t>(v)); });
    } else {
      for (std::size_t i = 0; i < vertices; ++i) indices.push_back(i);
    }
    return asList(indices, primitive.value("mode", kTriangles));
  }

  void readPrimitive(const json& primitive, const glm::dmat4& world, std::uint32_t node) {
    if (const int mode = primitive.value("mode", kTriangles); mode < kTriangles || mode > kFan) return;  // no surface
    const auto& attributes = primitive.at("attributes");
    const auto material =
        primitive.contains("material") ? materials_.at(primitive["material"].get<std::size_t>()) : defaultMaterial();
    auto like = triangleOf(material);
    like.node = node;
    if (primitive.contains("material")) like.material = primitive["material"].get<std::uint32_t>();
    const auto extras = primitive.value("extras", json::object());
    if (extras.is_object() && attributes.contains("TEXCOORD_1")) like.lightmap_page = extras.value("lightmap", -1);
    const auto vertices = readVertices(primitive, material, world);
    const auto indices = readIndices(primitive, vertices.positions.size());
    const bool flipped = glm::determinant(world) < 0.0;
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
      std::array<std::size_t, 3> corners{indices[i], indices[i + 1], indices[i + 2]};
      if (flipped) std::swap(corners[1], corners[2]);
      appendTriangle(like, vertices, corners);
    }
  }

  static Triangle triangleOf(const MaterialValues& values) {
    Triangle triangle;
    triangle.reflectance = values.reflectance;
    triangle.emission_lux = values.emission_lux;
    triangle.double_sided = values.double_sided;
    triangle.base_colour.texture = values.base_colour.texture;
    triangle.emissive.texture = values.emissive.texture;
    triangle.metallic = values.metallic;
    triangle.metal.texture = values.metal.texture;
    triangle.specular = values.specular;
    triangle.specular_texture.texture = values.specular_texture.texture;
    triangle.see_through = values.see_through;
    triangle.alpha = values.alpha;
    triangle.cutoff = values.cutoff;
    triangle.transmission = values.transmission;
    triangle.passing.texture = values.passing.texture;
    triangle.mirror = values.mirror;
    triangle.diffuse_transmission = values.diffuse_transmission;
    triangle.transmitted = values.transmitted;
    triangle.transmission_part.texture = values.transmission_part.texture;
    triangle.transmission_colour.texture = values.transmission_colour.texture;
    return triangle;
  }

  void appendTriangle(const Triangle& like, const Vertices& vertices, const std::array<std::size_t, 3>& corners) {
    auto triangle = like;
    for (std::size_t k = 0; k < 3; ++k) {
      const auto vertex = corners[k];
      triangle.corners[k] = vertices.positions.at(vertex);
      triangle.shading[k] = vertices.normals.at(vertex);
      triangle.lightmap_uv[k] = vertices.lightmap_uvs.at(vertex);
      triangle.base_colour.uv[k] = vertices.base_colour.at(vertex);
      triangle.emissive.uv[k] = vertices.emissive.at(vertex);
      triangle.metal.uv[k] = vertices.metal.at(vertex);
      triangle.specular_texture.uv[k] = vertices.specular.at(vertex);
      triangle.passing.uv[k] = vertices.passing.at(vertex);
      triangle.transmission_part.uv[k] = vertices.transmission_part.at(vertex);
      triangle.transmission_colour.uv[k] = vertices.transmission_colour.at(vertex);
      triangle.colours[k] = vertices.colours.at(vertex);
    }
    const auto& [a, b, c] = triangle.corners;
    const auto normal = glm::cross(b - a, c - a);
    if (!(glm::length(normal) > 0.0)) return;
    triangle.normal = glm::normalize(normal);
    const auto& colour = triangle.colours;
    triangle.coloured = colour[1] != colour[0] || colour[2] != colour[0];
    if (!triangle.coloured) {
      triangle.reflectance *= glm::dvec3(colour[0]);
      triangle.mirror.colour *= glm::dvec3(colour[0]);
      if (triangle.see_through) triangle.alpha *= colour[0].w;
    }
    // What varies is bounded where it is read.
    if (!triangle.coloured && triangle.base_colour.texture < 0)
      triangle.reflectance = glm::min(triangle.reflectance, glm::dvec3(kMostReflectance));
    scene_.triangles.push_back(triangle);
  }

  GltfFile file_;
  std::vector<MaterialValues> materials_;
  std::vector<double> weights_;  ///< of the morph targets of the mesh that is being read
  TriangleScene scene_;
};

}  // namespace

TriangleScene readGlb(const std::filesystem::path& file) {
  try {
    return Reader(file).read();
  } catch (const std::exception& error) {
    throw std::runtime_error(file.filename().string() + ": " + error.what());
  }
}

}  // namespace radiosity::oracle
