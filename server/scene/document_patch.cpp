// applyPatch: RFC 6902 plus the rules that keep indices and bytes meaningful (protocol: the scene is glTF).
#include <algorithm>
#include <array>
#include <string_view>

#include "server/scene/document.h"
#include "server/scene/document_defaults.h"
#include "server/scene/json_patch.h"

namespace radiosity::scene {
namespace {

bool isOneOf(const std::string& token, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), token) != names.end();
}

/// Length of the path of an array whose elements others refer to by index, when `path` is in one; else 0.
std::size_t indexedArrayDepth(const Tokens& path) {
  if (path.size() > 2 && path[0] == "extensions" && path[1] == "KHR_lights_punctual" && path[2] == "lights") return 3;
  const bool listed = isOneOf(path[0], {"accessors", "animations", "bufferViews", "cameras", "materials", "meshes",
                                        "nodes", "samplers", "scenes", "skins", "textures"});
  return listed ? 1 : 0;
}

/// Null where there is none.
const Json* find(const Json& document, const Tokens& path, std::size_t depth) {
  const auto* at = &document;
  for (std::size_t i = 0; i < depth; ++i) {
    if (!at->is_object()) return nullptr;
    const auto found = at->find(path[i]);
    if (found == at->end()) return nullptr;
    at = &*found;
  }
  return at;
}

std::string whyNot(const Json& document, const std::string& op, const Tokens& path) {
  if (path.empty()) return "the whole scene is replaced by loading another";
  if (isOneOf(path[0], {"buffers", "images"})) return "buffers and images cannot be changed; load another scene";
  if (path[0] == "bufferViews" && path.size() > 2) return "buffer views cannot be changed; append one";
  const auto depth = indexedArrayDepth(path);
  const auto* array = depth == 0 ? nullptr : find(document, path, depth);
  if (array == nullptr || !array->is_array()) return {};
  if (path.size() == depth && !array->empty())
    return "an array that others index cannot be replaced; edit its elements";
  if (path.size() != depth + 1) return {};
  if (op == "remove") return "removing an element would renumber the others; detach it instead";
  if (op == "replace" && path[0] == "bufferViews") return "buffer views cannot be changed; append one";
  if (op == "add" && path.back() != std::to_string(array->size())) {
    return "inserting an element would renumber the others; append with '-'";
  }
  return {};
}

}  // namespace

Result<Document> applyPatch(const Document& document, const nlohmann::json& patch) {
  auto gltf = applyJsonPatch(document.gltf, patch, whyNot);
  if (!gltf) return tl::unexpected(gltf.error());
  Document out = {document.name, std::move(*gltf), document.buffers, document.images};
  materialiseDefaults(out.gltf);  // of what was added
  return out;
}

}  // namespace radiosity::scene
