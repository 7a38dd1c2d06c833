#include "server/scene/import/placed_nodes.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <utility>
#include <vector>

#include "server/scene/document/json_text.h"
#include "server/scene/import/import_instancing.h"
#include "server/scene/import/node_transform.h"

namespace radiosity::scene {
namespace {

const Json* extrasOf(const Json& node, const char* member) {
  const auto* extras = memberOf(node, "extras");
  return extras != nullptr ? memberOf(*extras, member) : nullptr;
}

/// By node: whether a channel of an animation moves it. Empty: there are no animations.
std::vector<bool> animatedNodes(const Json& gltf) {
  const auto* animations = memberOf(gltf, "animations");
  const auto* nodes = memberOf(gltf, "nodes");
  if (animations == nullptr || !animations->is_array() || nodes == nullptr || !nodes->is_array()) return {};
  std::vector<bool> animated(nodes->size(), false);
  for (const auto& animation : *animations) {
    const auto* channels = memberOf(animation, "channels");
    if (channels == nullptr || !channels->is_array()) continue;
    for (const auto& channel : *channels) {
      const auto* target = memberOf(channel, "target");
      const auto* node = target != nullptr ? memberOf(*target, "node") : nullptr;
      if (node == nullptr || !node->is_number_integer() || *node < 0) continue;
      if (const auto index = node->get<std::uint64_t>(); index < animated.size()) animated[index] = true;
    }
  }
  return animated;
}

glm::dmat4 localMatrix(const Json& node) {
  const auto numbers = [&](const char* member, auto otherwise) {
    const auto* json = memberOf(node, member);
    if (json != nullptr)
      for (int i = 0; i < otherwise.length(); ++i) otherwise[i] = (*json)[static_cast<std::size_t>(i)].get<double>();
    return otherwise;
  };
  if (const auto* matrix = memberOf(node, "matrix")) {
    glm::dmat4 m(1.0);
    for (int i = 0; i < 16; ++i) m[i / 4][i % 4] = (*matrix)[static_cast<std::size_t>(i)].get<double>();
    return m;
  }
  const auto turn = numbers("rotation", glm::dvec4(0.0, 0.0, 0.0, 1.0));
  return Trs{numbers("translation", glm::dvec3(0.0)), glm::normalize(glm::dquat(turn.w, turn.x, turn.y, turn.z)),
             numbers("scale", glm::dvec3(1.0))}
      .matrix();
}

class NodeWalk {
 public:
  NodeWalk(const Document& document, const char* member)
      : document_(document),
        member_(member),
        nodes_(document.gltf.at("nodes")),
        animated_(animatedNodes(document.gltf)) {}

  Result<void> run(const std::function<Result<void>(const PlacedNode&)>& visit) {
    const auto roots = rootNodes();
    for (auto root = roots.rbegin(); root != roots.rend(); ++root) stack_.push_back({.index = *root});
    while (!stack_.empty()) {
      auto node = std::move(stack_.back());
      stack_.pop_back();
      enter(node);
      if (node.extras != nullptr)
        if (auto ok = take(node, visit); !ok) return ok;
      const auto below = childrenOf(*node.json);
      for (auto child = below.rbegin(); child != below.rend(); ++child)
        stack_.push_back({.index = *child, .world = node.world, .visible = node.visible, .animated = node.animated});
    }
    return {};
  }

 private:
  /// From what it has of its parent.
  void enter(PlacedNode& node) const {
    node.json = &nodes_[node.index];
    node.extras = extrasOf(*node.json, member_);
    const auto* name = memberOf(*node.json, "name");
    if (name != nullptr && name->is_string()) node.name = name->get<std::string>();
    const auto* visibility = extensionOf(*node.json, "KHR_node_visibility");
    node.world = node.world * localMatrix(*node.json);
    node.visible = node.visible && (visibility == nullptr || visibility->value("visible", true));
    node.animated = node.animated || (!animated_.empty() && animated_[node.index]);
  }

  Result<void> take(const PlacedNode& node, const std::function<Result<void>(const PlacedNode&)>& visit) const {
    if (isFinite(node.world)) return visit(node);
    return fail(ErrorCode::kInvalidScene, "its world transform is not finite",
                place(document_.name, "/nodes/" + std::to_string(node.index) + "/extras/" + member_));
  }

  [[nodiscard]] static std::vector<std::size_t> childrenOf(const Json& json, const char* member = "children") {
    const auto* children = memberOf(json, member);
    return children != nullptr ? children->get<std::vector<std::size_t>>() : std::vector<std::size_t>();
  }

  /// Of the scene to show: /scene, else the first of /scenes, else every node without a parent.
  [[nodiscard]] std::vector<std::size_t> rootNodes() const {
    const auto* scenes = memberOf(document_.gltf, "scenes");
    if (scenes != nullptr && !scenes->empty())
      return childrenOf((*scenes)[document_.gltf.value("scene", std::size_t{0})], "nodes");
    std::vector<bool> has_parent(nodes_.size(), false);
    for (const auto& node : nodes_)
      for (const auto child : childrenOf(node)) has_parent[child] = true;
    std::vector<std::size_t> roots;
    for (std::size_t n = 0; n < has_parent.size(); ++n)
      if (!has_parent[n]) roots.push_back(n);
    return roots;
  }

  const Document& document_;
  const char* member_;
  const Json& nodes_;
  std::vector<bool> animated_;
  std::vector<PlacedNode> stack_;
};

}  // namespace

Result<void> forEachPlacedNode(const Document& document, const char* member,
                               const std::function<Result<void>(const PlacedNode&)>& visit) {
  const auto* nodes = memberOf(document.gltf, "nodes");
  const auto has_it = [&](const Json& node) { return extrasOf(node, member) != nullptr; };
  if (nodes == nullptr || std::none_of(nodes->begin(), nodes->end(), has_it)) return {};
  return NodeWalk(document, member).run(visit);
}

Result<void> requireOnePlace(const std::string& document, const PlacedNode& node, const std::string& pointer,
                             const std::string& what) {
  if (extensionOf(*node.json, "EXT_mesh_gpu_instancing") != nullptr)
    return fail(ErrorCode::kInvalidScene,
                "must not be on a node with EXT_mesh_gpu_instancing: " + what + " lies in one place",
                place(document, pointer));
  if (node.animated)
    return fail(ErrorCode::kInvalidScene,
                "must not be on a node that an animation moves, or below one: animations are not played, and " + what +
                    " lies in one place",
                place(document, pointer));
  return {};
}

}  // namespace radiosity::scene
