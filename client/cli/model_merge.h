// Puts the content of one glTF file into another scene: what `radiosity add` sends. Pure functions.
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>

#include "common/result.h"

namespace radiosity::cli {

using Json = nlohmann::json;

/// A file in parts: the JSON, and what its first buffer holds where that has no `uri` (GLB).
struct Model {
  Json gltf;
  std::string bin;
};

/// Splits a GLB (glTF 2.0, section 4.4). `name` is for the error, kBadInput.
[[nodiscard]] Result<Model> splitModel(std::string_view glb, const std::string& name);

struct Placement {
  std::string name;                     ///< of the new node; a number is added where it is taken
  std::array<double, 3> translation{};  ///< metres, in the parent's frame
  std::optional<std::string> parent;    ///< @NAME or /nodes/N; none: a root of the scene
};

struct Merge {
  Json patch;
  std::string node;  ///< the new node as the commands take it, "@table"
};

/// A patch that appends everything of the model but animations and skins, with its indices moved along, below one new
/// node. Buffers keep their URIs; `bin_uri` becomes that of the GLB's own.
[[nodiscard]] Result<Merge> mergeModel(const Json& scene, const Json& model, const std::string& bin_uri,
                                       const Placement& placement);

}  // namespace radiosity::cli
