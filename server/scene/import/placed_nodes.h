// Nodes of a document with something of our own in their extras, where they stand in the world. Pure; any thread.
#pragma once

#include <cstddef>
#include <functional>
#include <glm/mat4x4.hpp>
#include <string>

#include "server/scene/document/document.h"

namespace radiosity::scene {

/// A node of the tree.
struct PlacedNode {
  std::size_t index = 0;
  const Json* json = nullptr;    ///< the node
  const Json* extras = nullptr;  ///< the member of its extras that was asked for
  std::string name = {};         ///< may be empty
  glm::dmat4 world{1.0};         ///< finite
  bool visible = true;           ///< and so are all above it
  bool animated = false;         ///< it, or a node above it, is moved by an animation
};

/// Calls visit(node) for the nodes that the document shows, in the order of the node tree, that have this member of
/// their extras, until it returns an error, which is returned. `document`: its nodes are checked, as import does.
/// O(nodes), little where no node has the member.
[[nodiscard]] Result<void> forEachPlacedNode(const Document& document, const char* member,
                                             const std::function<Result<void>(const PlacedNode&)>& visit);

/// kInvalidScene where the node has many places, or one that an animation changes. `what`: "a plane".
[[nodiscard]] Result<void> requireOnePlace(const std::string& document, const PlacedNode& node,
                                           const std::string& pointer, const std::string& what);

}  // namespace radiosity::scene
