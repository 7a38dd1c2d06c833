#include "tests/scenes/glb_writer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <fstream>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <nlohmann/json.hpp>
#include <set>
#include <stdexcept>
#include <string>

namespace radiosity::test_scenes {
namespace {

using nlohmann::json;
using Bytes = std::vector<std::uint8_t>;

constexpr int kFloat = 5126;
constexpr int kUnsignedShort = 5123;
constexpr int kUnsignedInt = 5125;

template <typename T>
void put(Bytes& out, T value) {
  static_assert(std::endian::native == std::endian::little);
  const auto raw = std::bit_cast<std::array<std::uint8_t, sizeof(T)>>(value);
  out.insert(out.end(), raw.begin(), raw.end());
}

json toJson(glm::dvec3 v) { return json::array({v.x, v.y, v.z}); }

struct Writer {
  Bytes bin;
  json views = json::array();
  json accessors = json::array();

  std::size_t view(const Bytes& bytes, int target) {
    while (bin.size() % 4 != 0) bin.push_back(0);
    views.push_back({{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", bytes.size()}, {"target", target}});
    bin.insert(bin.end(), bytes.begin(), bytes.end());
    return views.size() - 1;
  }

  std::size_t vectors(const std::vector<glm::vec3>& values, bool with_bounds) {
    Bytes bytes;
    glm::vec3 low(INFINITY);
    glm::vec3 high(-INFINITY);
    for (const auto& v : values) {
      for (int axis = 0; axis < 3; ++axis) put(bytes, v[axis]);
      low = glm::min(low, v);
      high = glm::max(high, v);
    }
    json accessor{
        {"bufferView", view(bytes, 34962)}, {"componentType", kFloat}, {"count", values.size()}, {"type", "VEC3"}};
    if (with_bounds) {
      accessor["min"] = toJson(low);
      accessor["max"] = toJson(high);
    }
    accessors.push_back(std::move(accessor));
    return accessors.size() - 1;
  }

  std::size_t indices(const std::vector<std::uint32_t>& values, std::size_t vertex_count) {
    const bool wide = vertex_count > 65535;
    Bytes bytes;
    for (const auto index : values) {
      if (wide) {
        put(bytes, index);
      } else {
        put(bytes, static_cast<std::uint16_t>(index));
      }
    }
    accessors.push_back({{"bufferView", view(bytes, 34963)},
                         {"componentType", wide ? kUnsignedInt : kUnsignedShort},
                         {"count", values.size()},
                         {"type", "SCALAR"}});
    return accessors.size() - 1;
  }

  /// The polygons of one material of an object, each with its own corners, as a fan of triangles.
  json primitive(const Object& object, std::uint32_t material) {
    std::vector<glm::vec3> positions;
    std::vector<glm::vec3> normals;
    std::vector<std::uint32_t> triangles;
    for (const auto& polygon : object.polygons) {
      if (polygon.material != material) continue;
      const auto first = static_cast<std::uint32_t>(positions.size());
      const glm::vec3 normal(glm::normalize(polygonNormal(polygon)));
      for (const auto& corner : polygon.corners) {
        positions.emplace_back(corner - object.origin);
        if (polygon.normals.empty()) normals.push_back(normal);
      }
      for (const auto& corner : polygon.normals) normals.emplace_back(corner);
      for (std::uint32_t i = 1; i + 1 < polygon.corners.size(); ++i) {
        triangles.insert(triangles.end(), {first, first + i, first + i + 1});
      }
    }
    const auto vertex_count = positions.size();
    return {{"attributes", {{"POSITION", vectors(positions, true)}, {"NORMAL", vectors(normals, false)}}},
            {"indices", indices(triangles, vertex_count)},
            {"material", material}};
  }
};

json materialJson(const Material& material) {
  const auto& rho = material.reflectance;
  json result{{"name", material.name},
              {"pbrMetallicRoughness",
               {{"baseColorFactor", json::array({rho.x, rho.y, rho.z, material.opacity})},
                {"metallicFactor", material.metallic},
                {"roughnessFactor", material.roughness}}}};
  if (material.opacity < 1.0) result["alphaMode"] = "BLEND";
  if (material.double_sided) result["doubleSided"] = true;
  if (material.transmission > 0.0)
    result["extensions"]["KHR_materials_transmission"] = {{"transmissionFactor", material.transmission}};
  if (material.diffuse_transmission > 0.0)
    result["extensions"]["KHR_materials_diffuse_transmission"] = {
        {"diffuseTransmissionFactor", material.diffuse_transmission},
        {"diffuseTransmissionColorFactor", toJson(material.transmitted)}};
  const auto& emission = material.emission_nits;
  const double strength = std::max({emission.x, emission.y, emission.z});
  if (strength <= 0.0) return result;
  result["emissiveFactor"] = toJson(emission / strength);
  result["extensions"]["KHR_materials_emissive_strength"] = {{"emissiveStrength", strength}};
  return result;
}

json cameraNode(const Camera& camera) {
  const auto back = glm::normalize(camera.position - camera.target);
  const auto right = glm::normalize(glm::cross(glm::dvec3(0.0, 1.0, 0.0), back));
  const glm::dquat q(glm::dmat3(right, glm::cross(back, right), back));
  return {{"name", "camera"},
          {"camera", 0},
          {"translation", toJson(camera.position)},
          {"rotation", json::array({q.x, q.y, q.z, q.w})}};
}

json cameraJson(const Camera& camera) {
  json perspective{{"yfov", camera.yfov_rad}, {"znear", 0.01}};
  if (camera.aspect > 0.0) perspective["aspectRatio"] = camera.aspect;
  return {{"type", "perspective"}, {"perspective", perspective}};
}

bool isArea(const Light& light) { return light.kind == Light::Kind::kRectangle || light.kind == Light::Kind::kDisc; }

const char* extensionOf(const Light& light) { return isArea(light) ? "EXT_lights_area" : "KHR_lights_punctual"; }

json lightJson(const Light& light) {
  constexpr std::array<const char*, 5> kNames{"point", "spot", "directional", "rect", "disk"};
  const auto& color = light.intensity;
  const double intensity = std::max({color.x, color.y, color.z});
  json result{{"type", kNames[static_cast<std::size_t>(light.kind)]},
              {"color", toJson(intensity > 0.0 ? color / intensity : glm::dvec3(1.0))},
              {"intensity", intensity}};
  if (light.range_m > 0.0) result["range"] = light.range_m;
  if (light.kind == Light::Kind::kSpot) {
    result["spot"] = {{"innerConeAngle", light.inner_cone_rad}, {"outerConeAngle", light.outer_cone_rad}};
  }
  if (isArea(light)) result["size"] = light.kind == Light::Kind::kDisc ? 2.0 * light.radius_m : light.height_m;
  if (light.kind == Light::Kind::kRectangle) result["rect"] = {{"aspect", light.width_m / light.height_m}};
  if (!isArea(light) && light.radius_m > 0.0) result["extras"] = {{"radiosityRadius", light.radius_m}};
  if (light.angle_deg > 0.0) result["extras"]["radiosityAngle"] = light.angle_deg;
  return result;
}

/// A light shines along its node's -Z.
json lightNode(const Light& light, std::size_t number, std::size_t index) {
  const auto back = glm::normalize(light.position - light.target);
  const auto helper = std::abs(back.y) < 0.9 ? glm::dvec3(0.0, 1.0, 0.0) : glm::dvec3(1.0, 0.0, 0.0);
  const auto right = glm::normalize(glm::cross(helper, back));
  const glm::dquat q(glm::dmat3(right, glm::cross(back, right), back));
  return {{"name", "light" + std::to_string(number)},
          {"extensions", {{extensionOf(light), {{"light", index}}}}},
          {"translation", toJson(light.position)},
          {"rotation", json::array({q.x, q.y, q.z, q.w})}};
}

void addLights(const TestScene& scene, json& gltf) {
  if (scene.sky_upper_nits != glm::dvec3(0.0) || scene.sky_lower_nits != glm::dvec3(0.0)) {
    gltf["extras"]["radiositySky"] = {{"upper", toJson(scene.sky_upper_nits)}, {"lower", toJson(scene.sky_lower_nits)}};
  }
  for (std::size_t i = 0; i < scene.lights.size(); ++i) {
    const auto& light = scene.lights[i];
    auto& lights = gltf["extensions"][extensionOf(light)]["lights"];
    if (lights.empty()) gltf["extensionsUsed"].push_back(extensionOf(light));
    gltf["nodes"].push_back(lightNode(light, i, lights.size()));
    lights.push_back(lightJson(light));
  }
}

json document(const TestScene& scene, Writer& writer) {
  json gltf{{"asset", {{"version", "2.0"}, {"generator", "radiosity test scenes"}}},
            {"scene", 0},
            {"nodes", json::array()},
            {"meshes", json::array()},
            {"materials", json::array()},
            {"cameras", json::array({cameraJson(scene.camera)})}};
  std::set<std::string> used;
  for (const auto& material : scene.materials) {
    gltf["materials"].push_back(materialJson(material));
    const auto extensions = gltf["materials"].back().value("extensions", json::object());
    for (const auto& [extension, value] : extensions.items()) used.insert(extension);
  }
  if (!used.empty()) gltf["extensionsUsed"] = used;
  for (const auto& object : scene.objects) {
    json primitives = json::array();
    for (std::uint32_t m = 0; m < scene.materials.size(); ++m) {
      const bool used = std::any_of(object.polygons.begin(), object.polygons.end(),
                                    [m](const Polygon& polygon) { return polygon.material == m; });
      if (used) primitives.push_back(writer.primitive(object, m));
    }
    gltf["nodes"].push_back({{"name", object.name}, {"mesh", gltf["meshes"].size()}});
    if (object.origin != glm::dvec3(0.0)) gltf["nodes"].back()["translation"] = toJson(object.origin);
    gltf["meshes"].push_back({{"name", object.name}, {"primitives", std::move(primitives)}});
  }
  addLights(scene, gltf);
  gltf["nodes"].push_back(cameraNode(scene.camera));
  json roots = json::array();
  for (std::size_t i = 0; i < gltf["nodes"].size(); ++i) roots.push_back(i);
  gltf["scenes"] = json::array({{{"name", scene.name}, {"nodes", std::move(roots)}}});
  return gltf;
}

}  // namespace

std::vector<std::uint8_t> encodeGlb(const TestScene& scene) {
  Writer writer;
  auto gltf = document(scene, writer);
  while (writer.bin.size() % 4 != 0) writer.bin.push_back(0);
  gltf["buffers"] = json::array({{{"byteLength", writer.bin.size()}}});
  gltf["bufferViews"] = std::move(writer.views);
  gltf["accessors"] = std::move(writer.accessors);
  auto text = gltf.dump();
  while (text.size() % 4 != 0) text.push_back(' ');

  Bytes out;
  put(out, std::uint32_t{0x46546C67});  // "glTF"
  put(out, std::uint32_t{2});
  put(out, static_cast<std::uint32_t>(12 + 8 + text.size() + 8 + writer.bin.size()));
  put(out, static_cast<std::uint32_t>(text.size()));
  put(out, std::uint32_t{0x4E4F534A});  // "JSON"
  out.insert(out.end(), text.begin(), text.end());
  put(out, static_cast<std::uint32_t>(writer.bin.size()));
  put(out, std::uint32_t{0x004E4942});  // "BIN"
  out.insert(out.end(), writer.bin.begin(), writer.bin.end());
  return out;
}

void writeGlb(const TestScene& scene, const std::filesystem::path& file) {
  const auto bytes = encodeGlb(scene);
  std::ofstream out(file, std::ios::binary);
  out.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  out.close();
  if (!out) throw std::runtime_error("cannot write " + file.string());
}

}  // namespace radiosity::test_scenes
