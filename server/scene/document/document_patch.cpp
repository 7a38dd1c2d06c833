// applyPatch: RFC 6902 plus the rules that keep indices and bytes meaningful (protocol: the scene is glTF).
#include <algorithm>
#include <array>
#include <string_view>

#include "server/scene/document/document.h"
#include "server/scene/document/document_defaults.h"
#include "server/scene/document/document_uploads.h"
#include "server/scene/document/json_patch.h"

namespace radiosity::scene {
namespace {

bool isOneOf(const std::string& token, std::initializer_list<std::string_view> names) {
  return std::find(names.begin(), names.end(), token) != names.end();
}

/// Length of the path of an array whose elements others refer to by index, when `path` is in one; else 0.
std::size_t indexedArrayDepth(const Tokens& path) {
  if (path.size() > 2 && path[0] == "extensions" && path[2] == "lights" &&
      isOneOf(path[1], {"EXT_lights_area", "EXT_lights_ies", "KHR_lights_punctual"}))
    return 3;
  const bool listed = isOneOf(path[0], {"accessors", "animations", "bufferViews", "buffers", "cameras", "images",
                                        "materials", "meshes", "nodes", "samplers", "scenes", "skins", "textures"});
  return listed ? 1 : 0;
}

/// Null where there is none. Indices in `path` are resolved, so digits.
const Json* find(const Json& document, const Tokens& path, std::size_t depth) {
  const auto* at = &document;
  for (std::size_t i = 0; i < depth; ++i) {
    if (at->is_array()) {
      const auto index = std::stoul(path[i]);
      if (index >= at->size()) return nullptr;
      at = &(*at)[index];
    } else if (const auto found = at->find(path[i]); found != at->end()) {  // end() for what is no object
      at = &*found;
    } else {
      return nullptr;
    }
  }
  return at;
}

/// Members whose numbers belong together: between two edits of single numbers a vector would be neither the old nor
/// the new one, and a colour short of a channel is none.
bool isInsideVector(const Json& document, const Tokens& path) {
  if (path.size() < 3 || !isOneOf(path[path.size() - 2], {"translation", "rotation", "scale", "matrix", "color",
                                                          "emissiveFactor", "baseColorFactor", "upper", "lower"}))
    return false;
  const auto* vector = find(document, path, path.size() - 1);
  return vector != nullptr && vector->is_array();
}

std::string pointerTo(const Tokens& path, std::size_t depth) {
  std::string pointer;
  for (std::size_t i = 0; i < depth; ++i) pointer += "/" + escapeToken(path[i]);
  return pointer;
}

std::string whyNot(const Json& document, const std::string& op, const Tokens& path) {
  if (path.empty()) return "the whole scene is replaced by loading another";
  if (isInsideVector(document, path)) return "a vector is replaced whole: " + pointerTo(path, path.size() - 1);
  const bool bytes = isOneOf(path[0], {"buffers", "images"});
  if (bytes && path.size() > 2) return "buffers and images cannot be changed; append one";
  if (path[0] == "bufferViews" && path.size() > 2) return "buffer views cannot be changed; append one";
  const auto depth = indexedArrayDepth(path);
  const auto* array = depth == 0 ? nullptr : find(document, path, depth);
  if (array == nullptr || !array->is_array()) return {};
  if (path.size() == depth && !array->empty())
    return "an array that others index cannot be replaced; edit its elements";
  if (path.size() != depth + 1) return {};
  if (op == "remove") return "removing an element would renumber the others; detach it instead";
  if (op == "replace" && bytes) return "buffers and images cannot be changed; append one";
  if (op == "replace" && path[0] == "bufferViews") return "buffer views cannot be changed; append one";
  if (op == "add" && path.back() != std::to_string(array->size())) {
    return "inserting an element would renumber the others; append with '-'";
  }
  return {};
}

Tokens tokensOf(std::string_view pointer) {
  Tokens tokens;
  for (const char c : pointer) {
    if (c == '/') {
      tokens.emplace_back();
    } else if (!tokens.empty()) {
      tokens.back() += c;
    }
  }
  return tokens;
}

/// Names the operation whose path shares most with the place of the fault; of several the last, which decided.
Error blame(Error error, const std::string& name, const std::vector<Tokens>& touched) {
  if (error.where.starts_with(name + ": ")) error.where.erase(0, name.size() + 2);
  if (error.operation) return error;
  const auto place = tokensOf(error.where);
  std::size_t best = 0;
  for (std::size_t i = 0; i < touched.size(); ++i) {
    const auto end = std::mismatch(touched[i].begin(), touched[i].end(), place.begin(), place.end()).first;
    const auto shared = static_cast<std::size_t>(end - touched[i].begin());
    if (shared < best || (shared == 0 && touched.size() > 1)) continue;
    best = shared;
    error.operation = static_cast<std::uint32_t>(i);
  }
  return error;
}

/// applyPatch(); `touched` as in applyJsonPatch(), also where the rest fails.
Result<Document> patched(const Document& document, const Json& patch, const FindUpload& uploads,
                         const ImportLimits& limits, std::vector<Tokens>& touched, TouchedParts& parts) {
  auto gltf = applyJsonPatch(document.gltf, patch, whyNot, &touched);
  if (!gltf) return tl::unexpected(gltf.error());
  parts = touchedParts(patch, touched);
  Document out = {document.name, std::move(*gltf), document.buffers, document.images};
  // What is not touched has its bytes, and is decoded; to look for more costs as much as the document is long.
  if (parts.all)
    if (auto ok = attachUploads(out, uploads, limits); !ok) return tl::unexpected(ok.error());
  materialiseDefaults(out.gltf, parts);  // of what was added
  return out;
}

}  // namespace

Result<Document> applyPatch(const Document& document, const nlohmann::json& patch, const FindUpload& uploads,
                            const ImportLimits& limits) {
  std::vector<Tokens> touched;
  TouchedParts parts;
  return patched(document, patch, uploads, limits, touched, parts);
}

Result<EditedDocument> editDocument(const Document& document, const nlohmann::json& patch, const FindUpload& uploads,
                                    const ImportLimits& limits) {
  std::vector<Tokens> touched;
  TouchedParts parts;
  auto next = patched(document, patch, uploads, limits, touched, parts);
  if (!next) return tl::unexpected(blame(next.error(), document.name, touched));
  auto edited = importEdited(std::move(*next), &document, limits, parts);
  if (!edited) return tl::unexpected(blame(edited.error(), document.name, touched));
  return edited;
}

}  // namespace radiosity::scene
