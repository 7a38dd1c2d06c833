// Transforms of nodes. Pure; any thread.
#pragma once

#include <glm/mat4x4.hpp>
#include <vector>

#include "server/scene/import/import_model.h"

namespace radiosity::scene {

[[nodiscard]] bool isFinite(const glm::dmat4& m);

/// Of a checked node, to its parent.
[[nodiscard]] glm::dmat4 localMatrix(const tinygltf::Node& node);

/// By node, to the world, also of those that no scene shows. Nodes must form trees.
[[nodiscard]] std::vector<glm::dmat4> worldMatrices(const tinygltf::Model& model);

/// Where a camera on `node` stands and looks. glTF has it ignore scale: that of its own node is not applied; of what
/// nodes above it scale or mirror, the picture keeps the directions ahead and up, at right angles and of unit length.
/// Turns nothing where these have no direction.
[[nodiscard]] glm::dmat4 cameraPose(const glm::dmat4& parent, const tinygltf::Node& node);

}  // namespace radiosity::scene
