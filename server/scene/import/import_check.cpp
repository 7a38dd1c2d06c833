#include "server/scene/import/import_check.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "common/task.h"
#include "server/scene/import/accessor.h"

namespace radiosity::scene {
namespace {

Result<void> checkBuffers(const ImportContext& context) {
  const auto& gltf = context.document.gltf;
  const auto size = [&](const char* list) { return gltf.contains(list) ? gltf[list].size() : 0; };
  if (size("buffers") != context.document.buffers.size())
    return context.bad("/buffers", "buffers cannot be added or removed");
  if (size("images") != context.document.images.size())
    return context.bad("/images", "images cannot be added or removed");
  for (std::size_t i = 0; i < context.document.buffers.size(); ++i) {
    const auto size = context.document.buffers[i]->size();
    if (size != 0 && gltf["buffers"][i]["byteLength"].get<std::size_t>() > size) {
      return context.bad("/buffers/" + std::to_string(i) + "/byteLength", "is more than the data has");
    }
  }
  return {};
}

Result<void> checkAccessors(const ImportContext& context) {
  for (std::size_t i = 0; i + 1 < context.model.bufferViews.size(); ++i) {
    if (auto ok = checkBufferView(context.document, context.model, i); !ok) return ok;
  }
  std::size_t total = 0;
  for (std::size_t i = 0; i < context.model.accessors.size(); ++i) {
    interruptionPoint();
    const auto pointer = "/accessors/" + std::to_string(i);
    if (auto ok = checkAccessor(context.document, context.model, i); !ok) return ok;
    total += context.model.accessors[i].count;
    if (total > context.limits.max_vertices) {
      return context.tooLarge(pointer + "/count",
                              "accessors have more than " + std::to_string(context.limits.max_vertices) + " elements");
    }
  }
  return {};
}

struct AttributeRule {
  const char* name;
  bool scalar, vec2, vec3, vec4;
};

constexpr AttributeRule kAttributes[] = {{"POSITION", false, false, true, false},
                                         {"NORMAL", false, false, true, false},
                                         {"TEXCOORD_0", false, true, false, false},
                                         {"TEXCOORD_1", false, true, false, false},
                                         {"COLOR_0", false, false, true, true}};

bool allowed(const AttributeRule& rule, int type) {
  return (rule.vec2 && type == TINYGLTF_TYPE_VEC2) || (rule.vec3 && type == TINYGLTF_TYPE_VEC3) ||
         (rule.vec4 && type == TINYGLTF_TYPE_VEC4);
}

Result<void> checkAttributes(const ImportContext& context, const tinygltf::Primitive& primitive,
                             const std::string& pointer) {
  std::size_t count = 0;
  for (const auto& [name, index] : primitive.attributes) {
    const auto& accessor = context.model.accessors[static_cast<std::size_t>(index)];
    const auto where = pointer + "/attributes/" + escapeToken(name);
    for (const auto& rule : kAttributes) {
      if (name == rule.name && !allowed(rule, accessor.type)) return context.bad(where, "accessor has the wrong type");
    }
    if (name == "NORMAL") continue;  // vertices without one are shaded flat (import_normals.h)
    if (count != 0 && accessor.count != count) return context.bad(where, "attributes differ in count");
    count = accessor.count;
    if (name == "POSITION" && accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT) {
      return context.bad(where, "accessor has the wrong component type");
    }
  }
  return {};
}

/// Morph targets move what the primitive has, and are copied with it.
Result<void> checkTargets(const ImportContext& context, const tinygltf::Primitive& primitive,
                          const std::string& pointer) {
  const auto positions = primitive.attributes.find("POSITION");
  if (positions == primitive.attributes.end()) return {};
  const auto count = context.model.accessors[static_cast<std::size_t>(positions->second)].count;
  for (std::size_t t = 0; t < primitive.targets.size(); ++t) {
    for (const auto& [name, index] : primitive.targets[t]) {
      const auto& accessor = context.model.accessors[static_cast<std::size_t>(index)];
      const auto where = pointer + "/targets/" + std::to_string(t) + "/" + escapeToken(name);
      if (accessor.count != count) return context.bad(where, "has not as many elements as the primitive has vertices");
      if ((name == "POSITION" || name == "NORMAL") && accessor.type != TINYGLTF_TYPE_VEC3)
        return context.bad(where, "accessor has the wrong type");
    }
  }
  return {};
}

Result<void> checkSkins(const ImportContext& context) {
  if (!context.document.gltf.contains("skins")) return {};
  const auto& skins = context.document.gltf["skins"];
  for (std::size_t s = 0; s < skins.size(); ++s) {
    if (!skins[s].contains("inverseBindMatrices")) continue;
    const auto& accessor = context.model.accessors[skins[s]["inverseBindMatrices"].get<std::size_t>()];
    const auto where = "/skins/" + std::to_string(s) + "/inverseBindMatrices";
    if (accessor.type != TINYGLTF_TYPE_MAT4 || accessor.componentType != TINYGLTF_COMPONENT_TYPE_FLOAT)
      return context.bad(where, "accessor must be MAT4 of floats");
    if (accessor.count < skins[s]["joints"].size()) return context.bad(where, "are fewer than the joints");
  }
  return {};
}

Result<void> checkIndices(const ImportContext& context, const tinygltf::Primitive& primitive,
                          const std::string& pointer) {
  if (primitive.indices < 0) return {};
  const auto& accessor = context.model.accessors[static_cast<std::size_t>(primitive.indices)];
  const bool integer = accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_BYTE ||
                       accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_SHORT ||
                       accessor.componentType == TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT;
  if (accessor.type != TINYGLTF_TYPE_SCALAR || !integer) {
    return context.bad(pointer + "/indices", "accessor must be SCALAR of an unsigned integer type");
  }
  return {};
}

Result<void> checkMeshes(const ImportContext& context) {
  for (std::size_t m = 0; m < context.model.meshes.size(); ++m) {
    const auto& primitives = context.model.meshes[m].primitives;
    for (std::size_t p = 0; p < primitives.size(); ++p) {
      interruptionPoint();
      const auto pointer = "/meshes/" + std::to_string(m) + "/primitives/" + std::to_string(p);
      if (auto ok = checkAttributes(context, primitives[p], pointer); !ok) return ok;
      if (auto ok = checkTargets(context, primitives[p], pointer); !ok) return ok;
      if (auto ok = checkIndices(context, primitives[p], pointer); !ok) return ok;
    }
  }
  return {};
}

/// Edits make children of root nodes: then two places must change at a time.
std::string notRoot(std::size_t node, std::size_t parent, const std::string& pointer) {
  const auto list = pointer.substr(0, pointer.rfind('/'));
  return "node " + std::to_string(node) + " is no root node: /nodes/" + std::to_string(parent) +
         "/children lists it; take it out of " + list + " in the same patch, or out of those children";
}

/// One parent at most, no cycles.
Result<void> checkTree(const ImportContext& context) {
  const auto& nodes = context.model.nodes;
  if (nodes.size() > context.limits.max_nodes) {
    return context.tooLarge("/nodes", "has more than " + std::to_string(context.limits.max_nodes) + " entries");
  }
  constexpr auto kNoParent = static_cast<std::size_t>(-1);
  std::vector<std::size_t> parents(nodes.size(), kNoParent);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    interruptionPoint();
    for (std::size_t c = 0; c < nodes[n].children.size(); ++c) {
      const auto child = static_cast<std::size_t>(nodes[n].children[c]);
      if (parents[child] != kNoParent) {
        return context.bad("/nodes/" + std::to_string(n) + "/children/" + std::to_string(c),
                           "node " + std::to_string(child) + " has two parents");
      }
      parents[child] = n;
    }
  }
  std::vector<std::size_t> stack;
  std::vector<bool> reached(nodes.size(), false);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    interruptionPoint();
    if (parents[n] == kNoParent) stack.push_back(n);
  }
  while (!stack.empty()) {
    const auto node = stack.back();
    stack.pop_back();
    reached[node] = true;
    for (const auto child : nodes[node].children) stack.push_back(static_cast<std::size_t>(child));
  }
  const auto lost = std::find(reached.begin(), reached.end(), false);
  if (lost != reached.end()) {
    return context.bad("/nodes/" + std::to_string(lost - reached.begin()) + "/children", "nodes form a cycle");
  }
  std::vector<std::size_t> listed_by(nodes.size(), context.model.scenes.size());  // scenes, one after the other
  for (std::size_t s = 0; s < context.model.scenes.size(); ++s) {
    for (std::size_t i = 0; i < context.model.scenes[s].nodes.size(); ++i) {
      const auto node = static_cast<std::size_t>(context.model.scenes[s].nodes[i]);
      const auto pointer = "/scenes/" + std::to_string(s) + "/nodes/" + std::to_string(i);
      if (parents[node] != kNoParent) return context.bad(pointer, notRoot(node, parents[node], pointer));
      if (listed_by[node] == s) return context.bad(pointer, "is listed twice");
      listed_by[node] = s;
    }
  }
  return {};
}

Result<void> checkTransforms(const ImportContext& context) {
  for (std::size_t n = 0; n < context.model.nodes.size(); ++n) {
    const auto& json = context.document.gltf["nodes"][n];
    const auto pointer = "/nodes/" + std::to_string(n);
    if (json.contains("matrix") &&
        (json.contains("translation") || json.contains("rotation") || json.contains("scale"))) {
      return context.bad(pointer, "has both matrix and translation, rotation or scale");
    }
    const auto& q = context.model.nodes[n].rotation;
    if (!q.empty() && !(std::hypot(std::hypot(q[0], q[1]), std::hypot(q[2], q[3])) > 1e-6)) {
      return context.bad(pointer + "/rotation", "is not a rotation: its length is zero");
    }
  }
  return {};
}

}  // namespace

Result<void> checkModel(ImportContext& context) {
  if (auto ok = checkBuffers(context); !ok) return ok;
  if (auto ok = checkAccessors(context); !ok) return ok;
  if (auto ok = checkMeshes(context); !ok) return ok;
  if (auto ok = checkSkins(context); !ok) return ok;
  if (auto ok = checkTree(context); !ok) return ok;
  return checkTransforms(context);
}

}  // namespace radiosity::scene
