// What people do most to a scene, as JSON Patches on its glTF. Pure functions of the document that the server gave;
// errors are kBadInput and say what is there instead. A thing is written @NAME or as a pointer (/nodes/3).
#pragma once

#include <array>
#include <nlohmann/json.hpp>
#include <string>

#include "common/result.h"

namespace radiosity::cli {

using Json = nlohmann::json;

/// "@lamp.emissiveStrength" or a JSON pointer, and the value as JSON, as numbers with commas, or as a word. Properties
/// are those of materials, lights and nodes; the node that has the material or the light may be named instead.
[[nodiscard]] Result<Json> setPatch(const Json& gltf, const std::string& target, const std::string& value);
/// The names that may follow "@NAME." and what they mean, for the help text.
[[nodiscard]] std::string propertyHelp();

/// Metres in the frame of the node's parent; `relative`: added to where it is.
[[nodiscard]] Result<Json> movePatch(const Json& gltf, const std::string& node, const std::array<double, 3>& metres,
                                     bool relative);
/// Turns by `degrees` about an axis through the node's origin, in its parent's frame; counter-clockwise when the axis
/// points at the eye. `absolute`: from no rotation at all.
[[nodiscard]] Result<Json> rotatePatch(const Json& gltf, const std::string& node, double degrees,
                                       const std::array<double, 3>& axis, bool absolute);
/// Multiplies the node's scale; no part of the factor may be 0.
[[nodiscard]] Result<Json> scalePatch(const Json& gltf, const std::string& node, const std::array<double, 3>& factor);
[[nodiscard]] Result<Json> visibilityPatch(const Json& gltf, const std::string& node, bool visible);
/// Detaches the node, and all below it, from its parent and its scenes; its index stays taken.
[[nodiscard]] Result<Json> removePatch(const Json& gltf, const std::string& node);

/// Index of the one node meant by "@NAME" or "/nodes/N".
[[nodiscard]] Result<std::size_t> findNode(const Json& gltf, const std::string& node);
/// "/nodes/@lamp" where the name is there once, else "/nodes/3".
[[nodiscard]] std::string pointerTo(const Json& gltf, const std::string& array, std::size_t index);

}  // namespace radiosity::cli
