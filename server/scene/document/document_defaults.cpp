#include "server/scene/document/document_defaults.h"

#include <algorithm>
#include <cmath>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/vec3.hpp>
#include <numbers>
#include <vector>

#include "common/task.h"

namespace radiosity::scene {
namespace {

constexpr const char* kLightsName = "KHR_lights_punctual";
constexpr const char* kAreaLightsName = "EXT_lights_area";
constexpr const char* kIesLightsName = "EXT_lights_ies";
constexpr const char* kVisibility = "KHR_node_visibility";
constexpr const char* kSpecularGlossinessName = "KHR_materials_pbrSpecularGlossiness";
constexpr const char* kDiffuseTransmissionName = "KHR_materials_diffuse_transmission";
constexpr const char* kEmissiveStrengthName = "KHR_materials_emissive_strength";

void setDefault(Json& object, const char* member, Json value) {
  if (!object.contains(member)) object[member] = std::move(value);
}

Json toJson(const glm::dvec3& v) { return Json::array({v.x, v.y, v.z}); }

bool readMatrix(const Json& matrix, double (&m)[16]) {
  if (!matrix.is_array() || matrix.size() != 16) return false;
  for (std::size_t i = 0; i < 16; ++i) {
    if (!matrix[i].is_number()) return false;
    m[i] = matrix[i].get<double>();
  }
  return true;
}

/// Column-major M = T R S when there is such a thing: the columns must be at right angles and none zero.
bool decompose(const double (&m)[16], Json& node) {
  if (m[3] != 0 || m[7] != 0 || m[11] != 0 || m[15] != 1) return false;
  glm::dmat3 rotation(m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]);
  glm::dvec3 scale(glm::length(rotation[0]), glm::length(rotation[1]), glm::length(rotation[2]));
  if (!(scale.x > 0 && scale.y > 0 && scale.z > 0)) return false;
  if (glm::determinant(rotation) < 0) scale.x = -scale.x;
  for (int c = 0; c < 3; ++c) rotation[c] /= scale[c];
  constexpr double kTolerance = 1e-5;  // matrices written in 32-bit float are orthogonal to about 1e-6
  const auto error = glm::transpose(rotation) * rotation - glm::dmat3(1.0);
  for (int c = 0; c < 3; ++c) {
    for (int r = 0; r < 3; ++r) {
      if (!(std::abs(error[c][r]) < kTolerance)) return false;
    }
  }
  const auto q = glm::normalize(glm::quat_cast(rotation));
  node["translation"] = toJson({m[12], m[13], m[14]});
  node["rotation"] = Json::array({q.x, q.y, q.z, q.w});
  node["scale"] = toJson(scale);
  return true;
}

bool materialiseVisibility(Json& node) {
  setDefault(node, "extensions", Json::object());
  auto& extensions = node["extensions"];
  if (!extensions.is_object()) return false;
  setDefault(extensions, kVisibility, Json::object());
  if (extensions[kVisibility].is_object()) setDefault(extensions[kVisibility], "visible", true);
  return true;
}

void materialiseTransform(Json& node) {
  const bool has_trs = node.contains("translation") || node.contains("rotation") || node.contains("scale");
  if (node.contains("matrix")) {
    double m[16];
    if (has_trs || !readMatrix(node["matrix"], m) || !decompose(m, node)) return;
    node.erase("matrix");
    return;
  }
  setDefault(node, "translation", toJson(glm::dvec3(0.0)));
  setDefault(node, "rotation", Json::array({0.0, 0.0, 0.0, 1.0}));
  setDefault(node, "scale", toJson(glm::dvec3(1.0)));
}

/// A file without scenes shows every node that has no parent; written out, so that a node can be detached from it.
void materialiseScenes(Json& gltf) {
  const auto nodes = gltf.find("nodes");
  if (nodes == gltf.end() || !nodes->is_array() || nodes->empty()) return;
  if (const auto scenes = gltf.find("scenes"); scenes != gltf.end() && !(scenes->is_array() && scenes->empty())) {
    setDefault(gltf, "scene", 0);
    return;
  }
  std::vector<bool> has_parent(nodes->size(), false);
  for (const auto& node : *nodes) {
    if (!node.is_object() || !node.contains("children") || !node["children"].is_array()) continue;
    for (const auto& child : node["children"]) {
      if (child.is_number_unsigned() && child.get<std::size_t>() < has_parent.size())
        has_parent[child.get<std::size_t>()] = true;
    }
  }
  Json roots = Json::array();
  for (std::size_t n = 0; n < has_parent.size(); ++n) {
    if (!has_parent[n]) roots.push_back(n);
  }
  if (roots.empty()) return;  // a cycle, which importScene refuses
  gltf["scenes"] = Json::array({{{"nodes", std::move(roots)}}});
  gltf["scene"] = 0;
}

bool materialiseMaterial(Json& material) {
  if (!material.is_object()) return false;
  setDefault(material, "pbrMetallicRoughness", Json::object());
  if (auto& pbr = material["pbrMetallicRoughness"]; pbr.is_object()) {
    setDefault(pbr, "baseColorFactor", Json::array({1.0, 1.0, 1.0, 1.0}));
    setDefault(pbr, "metallicFactor", 1.0);
    setDefault(pbr, "roughnessFactor", 1.0);
  }
  setDefault(material, "emissiveFactor", toJson(glm::dvec3(0.0)));
  setDefault(material, "alphaMode", "OPAQUE");
  setDefault(material, "alphaCutoff", 0.5);
  setDefault(material, "doubleSided", false);
  setDefault(material, "extensions", Json::object());
  auto& extensions = material["extensions"];
  if (!extensions.is_object()) return false;
  setDefault(extensions, kEmissiveStrengthName, Json::object());
  auto& strength = extensions[kEmissiveStrengthName];
  if (strength.is_object()) setDefault(strength, "emissiveStrength", 1.0);
  if (const auto found = extensions.find(kSpecularGlossinessName); found != extensions.end() && found->is_object()) {
    setDefault(*found, "diffuseFactor", Json::array({1.0, 1.0, 1.0, 1.0}));
    setDefault(*found, "specularFactor", Json::array({1.0, 1.0, 1.0}));
    setDefault(*found, "glossinessFactor", 1.0);
  }
  if (const auto found = extensions.find(kDiffuseTransmissionName); found != extensions.end() && found->is_object()) {
    setDefault(*found, "diffuseTransmissionFactor", 0.0);
    setDefault(*found, "diffuseTransmissionColorFactor", Json::array({1.0, 1.0, 1.0}));
  }
  return true;
}

/// The lights of a root extension; null: there are none.
Json* lightsOf(Json& gltf, const char* name) {
  const auto extensions = gltf.find("extensions");
  if (extensions == gltf.end() || !extensions->is_object() || !extensions->contains(name)) return nullptr;
  auto& extension = (*extensions)[name];
  if (!extension.is_object() || !extension.contains("lights") || !extension["lights"].is_array()) return nullptr;
  return &extension["lights"];
}

void materialiseLights(Json& gltf) {
  auto* lights = lightsOf(gltf, kLightsName);
  if (lights == nullptr) return;
  for (auto& light : *lights) {
    if (!light.is_object()) continue;
    setDefault(light, "color", Json::array({1.0, 1.0, 1.0}));
    setDefault(light, "intensity", 1.0);
    if (!light.contains("spot") || !light["spot"].is_object()) continue;
    setDefault(light["spot"], "innerConeAngle", 0.0);
    setDefault(light["spot"], "outerConeAngle", std::numbers::pi / 4.0);
  }
}

void materialiseAreaLights(Json& gltf) {
  auto* lights = lightsOf(gltf, kAreaLightsName);
  if (lights == nullptr) return;
  for (auto& light : *lights) {
    if (!light.is_object()) continue;
    setDefault(light, "color", Json::array({1.0, 1.0, 1.0}));
    setDefault(light, "intensity", 1000.0);
    setDefault(light, "size", 1.0);
    if (light.value("type", Json()) != "rect") continue;
    setDefault(light, "rect", Json::object());
    if (light["rect"].is_object()) setDefault(light["rect"], "aspect", 1.0);
  }
}

/// Of a node whose light has a web: colour and strength are its own.
void materialiseIes(Json& node) {
  const auto extensions = node.find("extensions");
  if (extensions == node.end() || !extensions->is_object() || !extensions->contains(kIesLightsName)) return;
  auto& light = (*extensions)[kIesLightsName];
  if (!light.is_object()) return;
  setDefault(light, "multiplier", 1.0);
  setDefault(light, "color", Json::array({1.0, 1.0, 1.0}));
}

void markUsed(Json& gltf, const char* extension) {
  setDefault(gltf, "extensionsUsed", Json::array());
  auto& used = gltf["extensionsUsed"];
  if (used.is_array() && std::find(used.begin(), used.end(), extension) == used.end()) used.push_back(extension);
}

/// Of a list of the document, where there is one, all elements, or `some` of them.
template <typename Do>
void forEach(Json& gltf, const char* member, bool all, const std::set<std::size_t>& some, const Do& act) {
  const auto list = gltf.find(member);
  if (list == gltf.end() || !list->is_array()) return;
  if (!all) {
    for (const auto i : some)
      if (i < list->size()) act((*list)[i]);
    return;
  }
  for (auto& element : *list) {
    interruptionPoint();
    act(element);
  }
}

}  // namespace

void materialiseDefaults(Json& gltf, const TouchedParts& parts) {
  if (!gltf.is_object()) return;
  bool visibility = false, strength = false;
  forEach(gltf, "nodes", parts.all, parts.nodes, [&](Json& node) {
    if (!node.is_object()) return;
    materialiseTransform(node);
    visibility |= materialiseVisibility(node);
    materialiseIes(node);
  });
  if (visibility) markUsed(gltf, kVisibility);
  materialiseScenes(gltf);
  forEach(gltf, "materials", parts.all, parts.materials,
          [&](Json& material) { strength |= materialiseMaterial(material); });
  materialiseLights(gltf);
  materialiseAreaLights(gltf);
  if (strength) markUsed(gltf, kEmissiveStrengthName);
}

}  // namespace radiosity::scene
