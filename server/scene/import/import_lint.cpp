#include "server/scene/import/import_lint.h"

#include <algorithm>
#include <array>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <numbers>
#include <set>
#include <string>

#include "common/task.h"
#include "server/scene/document/image_decode.h"
#include "server/scene/import/node_transform.h"

namespace radiosity::scene {
namespace {

constexpr const char* kMaterialList = "materials";

/// Names of all extensions used in a value; they nest at most 64 deep.
void collectExtensions(const Json& value, std::set<std::string>& names) {
  if (!value.is_structured()) return;
  for (const auto& [key, child] : value.items()) {
    interruptionPoint();
    if (value.is_object() && key == "extras") continue;
    if (value.is_object() && key == "extensions" && child.is_object()) {
      for (const auto& extension : child.items()) names.insert(extension.key());
    }
    collectExtensions(child, names);
  }
}

void warnUndeclared(ImportContext& context, std::set<std::string> names) {
  const auto& gltf = context.document.gltf;
  if (const auto found = gltf.find(kMaterialList); found != gltf.end()) collectExtensions(*found, names);
  const auto declared = gltf.value("extensionsUsed", Json::array());
  for (const auto& name : names) {
    if (std::find(declared.begin(), declared.end(), name) != declared.end()) continue;
    context.warn("/extensionsUsed", name + " is used but not listed");
  }
}

void warnAccessors(ImportContext& context) {
  for (std::size_t i = 0; i < context.model.accessors.size(); ++i) {
    const auto& accessor = context.model.accessors[i];
    const bool wide = accessor.componentType == TINYGLTF_COMPONENT_TYPE_FLOAT ||
                      accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
    if (accessor.normalized && wide) {
      context.warn("/accessors/" + std::to_string(i) + "/normalized", "means nothing for this component type");
    }
  }
}

bool isKnownAttribute(const std::string& name) {
  constexpr std::array<const char*, 4> kNumbered = {"TEXCOORD_", "COLOR_", "JOINTS_", "WEIGHTS_"};
  if (name == "POSITION" || name == "NORMAL" || name == "TANGENT" || name.rfind('_', 0) == 0) return true;
  return std::any_of(kNumbered.begin(), kNumbered.end(), [&](const char* p) { return name.rfind(p, 0) == 0; });
}

void warnMeshes(ImportContext& context) {
  std::set<int> placed;
  for (const auto& node : context.model.nodes) placed.insert(node.mesh);
  for (std::size_t m = 0; m < context.model.meshes.size(); ++m) {
    const auto mesh = "/meshes/" + std::to_string(m);
    if (placed.count(static_cast<int>(m)) == 0) context.warn(mesh, "no node places it; not read");
    for (std::size_t p = 0; p < context.model.meshes[m].primitives.size(); ++p) {
      interruptionPoint();
      const auto pointer = mesh + "/primitives/" + std::to_string(p) + "/attributes/";
      for (const auto& [name, accessor] : context.model.meshes[m].primitives[p].attributes) {
        if (!isKnownAttribute(name)) context.warn(pointer + escapeToken(name), "unknown attribute; ignored");
      }
    }
  }
}

constexpr double kFarthest = 1e12;  ///< metres

/// Of many places with the same oddity one warning, at the first.
class OddPlaces {
 public:
  explicit OddPlaces(const char* what) : what_(what) {}
  void add(const std::string& pointer) {
    if (count_++ == 0) first_ = pointer;
  }
  void tell(ImportContext& context, const char* others) const {
    if (count_ == 0) return;
    context.warn(first_, count_ == 1 ? what_ : what_ + "; so it is in " + std::to_string(count_ - 1) + others);
  }

 private:
  std::string what_, first_;
  std::size_t count_ = 0;
};

OddPlaces flatPlaces() { return OddPlaces("is 0; triangles below have no area and are dropped"); }
OddPlaces farPlaces() { return OddPlaces("is beyond 1e12 m, where numbers are too coarse for the shape of a thing"); }

bool isFar(const glm::dvec3& translation) {
  return glm::any(glm::greaterThan(glm::abs(translation), glm::dvec3(kFarthest)));
}
bool isFlat(const glm::dvec3& scale) { return glm::any(glm::equal(scale, glm::dvec3(0.0))); }

void warnTransforms(ImportContext& context) {
  auto flat = flatPlaces(), far = farPlaces();
  for (std::size_t n = 0; n < context.model.nodes.size(); ++n) {
    const auto& node = context.model.nodes[n];
    const auto pointer = [n] { return "/nodes/" + std::to_string(n); };
    const bool has_matrix = !node.matrix.empty();
    const auto local = localMatrix(node);
    const glm::dvec3 sides(glm::length(glm::dvec3(local[0])), glm::length(glm::dvec3(local[1])),
                           glm::length(glm::dvec3(local[2])));
    if (isFlat(sides)) flat.add(pointer() + (has_matrix ? "/matrix" : "/scale"));
    if (isFar(glm::dvec3(local[3]))) far.add(pointer() + (has_matrix ? "/matrix" : "/translation"));
  }
  flat.tell(context, " other nodes");
  far.tell(context, " other nodes");
}

void warnNodes(ImportContext& context) {
  for (std::size_t n = 0; n < context.model.nodes.size(); ++n) {
    const auto& node = context.model.nodes[n];
    if (node.mesh >= 0) continue;
    const auto pointer = "/nodes/" + std::to_string(n);
    if (node.skin >= 0) context.warn(pointer + "/skin", "means nothing without a mesh");
    if (!node.weights.empty()) context.warn(pointer + "/weights", "mean nothing without a mesh");
  }
}

void warnCameras(ImportContext& context) {
  for (std::size_t i = 0; i < context.model.cameras.size(); ++i) {
    const auto& json = context.document.gltf["cameras"][i];
    const auto pointer = "/cameras/" + std::to_string(i);
    if (json.contains("perspective") && json.contains("orthographic")) context.warn(pointer, "has two projections");
    const auto& projection = json[json["type"].get<std::string>()];
    if (projection.contains("zfar") && projection["zfar"].get<double>() <= projection["znear"].get<double>()) {
      context.warn(pointer, "zfar is not beyond znear");
    }
  }
}

void warnLights(ImportContext& context) {
  for (std::size_t i = 0; i < context.model.lights.size(); ++i) {
    const auto& light = context.model.lights[i];
    const auto& json = context.document.gltf["extensions"]["KHR_lights_punctual"]["lights"][i];
    if (light.type == "directional" && json.value("extras", Json()).contains("radiosityRadius"))
      context.warn("/extensions/KHR_lights_punctual/lights/" + std::to_string(i) + "/extras/radiosityRadius",
                   "means nothing to a directional light");
    if (light.type != "spot") continue;
    const auto pointer = "/extensions/KHR_lights_punctual/lights/" + std::to_string(i) + "/spot/";
    if (light.spot.outerConeAngle > std::numbers::pi / 2 + 1e-6)
      context.warn(pointer + "outerConeAngle", "is above pi/2; lit as pi/2");
    if (light.spot.innerConeAngle >= light.spot.outerConeAngle)
      context.warn(pointer + "innerConeAngle", "is not below outerConeAngle; lit with a hard edge");
  }
}

void warnBuffers(ImportContext& context) {
  for (std::size_t i = 0; i < context.document.buffers.size(); ++i) {
    if (context.document.buffers[i]->empty()) context.warn("/buffers/" + std::to_string(i), "has no data");
  }
}

void warnImages(ImportContext& context) {
  for (std::size_t i = 0; i < context.document.images.size(); ++i) {
    const auto type = sniffImageType(*context.document.images[i]);
    const auto pointer = "/images/" + std::to_string(i);
    const auto said = context.document.gltf["images"][i].value("mimeType", type);
    if (type.empty()) {
      context.warn(pointer, "is neither PNG nor JPEG nor WebP");
    } else if (said != type) {
      context.warn(pointer + "/mimeType", "says " + said + ", but the data is " + type);
    }
  }
}

}  // namespace

void warnAboutElements(ImportContext& context, const std::vector<Trs>& elements, const std::string& pointer) {
  auto flat = flatPlaces(), far = farPlaces();
  for (const auto& element : elements) {
    if (isFlat(element.scale)) flat.add(pointer + "/SCALE");
    if (isFar(element.translation)) far.add(pointer + "/TRANSLATION");
  }
  flat.tell(context, " other elements");
  far.tell(context, " other elements");
}

std::set<std::string> extensionsBesideMaterials(const Json& gltf) {
  std::set<std::string> names;
  for (const auto& [member, value] : gltf.items()) {
    if (member == kMaterialList || member == "extras") continue;
    if (member == "extensions" && value.is_object()) {
      for (const auto& extension : value.items()) names.insert(extension.key());
    }
    collectExtensions(value, names);
  }
  return names;
}

void warnAboutOddities(ImportContext& context, std::set<std::string> extensions) {
  warnUndeclared(context, std::move(extensions));
  warnAccessors(context);
  warnMeshes(context);
  warnNodes(context);
  warnTransforms(context);
  warnCameras(context);
  warnLights(context);
  warnBuffers(context);
  warnImages(context);
  const auto& gltf = context.document.gltf;
  if (gltf.contains("animations")) context.warn("/animations", "are ignored; the scene is lit at rest");
}

}  // namespace radiosity::scene
