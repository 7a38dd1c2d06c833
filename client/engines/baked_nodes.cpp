#include "client/engines/baked_nodes.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "client/engines/gltf_json.h"

namespace radiosity::engines {
namespace {

constexpr std::array kLamps = {"KHR_lights_punctual", "EXT_lights_area", "EXT_lights_ies"};
constexpr std::array kSkies = {"EXT_lights_image_based", "KHR_environment_map"};

/// Appends the node numbers in the list of[name].
void addIndices(Json& of, const char* name, std::vector<std::size_t>& to) {
  const auto* list = member(of, name);
  if (list == nullptr || !list->is_array()) return;
  for (const auto& index : *list)
    if (index.is_number_unsigned()) to.push_back(index.get<std::size_t>());
}

/// Whether each node is among `open` or below one of these.
std::vector<bool> withAllBelow(Json& nodes, std::vector<std::size_t> open) {
  std::vector<bool> seen(nodes.size(), false);
  while (!open.empty()) {
    const auto node = open.back();
    open.pop_back();
    if (node >= nodes.size() || seen[node]) continue;
    seen[node] = true;
    addIndices(nodes[node], "children", open);
  }
  return seen;
}

/// Which nodes the server solves: those of /scene, else of the first scene, else all.
std::vector<bool> nodesOfScene(Json& gltf, Json& nodes) {
  auto* scenes = member(gltf, "scenes");
  if (scenes == nullptr || !scenes->is_array() || scenes->empty()) return std::vector<bool>(nodes.size(), true);
  std::vector<std::size_t> roots;
  addIndices((*scenes)[indexIn(gltf, "scene", scenes->size()).value_or(0)], "nodes", roots);
  return withAllBelow(nodes, std::move(roots));
}

/// The element of the list that `name` has at the top of the file, if the node names one, with what the node itself
/// says of it (EXT_lights_ies: "multiplier" and "color").
Json lampOf(Json& gltf, Json& use, const char* name) {
  if (!use.is_object()) return Json::object();
  auto* all = extension(gltf, name);
  auto* lights = all == nullptr ? nullptr : member(*all, "lights");
  const auto index = lights == nullptr || !lights->is_array() ? std::nullopt : indexIn(use, "light", lights->size());
  if (!index || !(*lights)[*index].is_object()) return use;
  Json lamp = (*lights)[*index];
  for (const auto& [key, value] : use.items())
    if (key != "light") lamp[key] = value;
  return lamp;
}

void keepAsBaked(Json& node, const Json& lamp) {
  auto* extras = member(node, "extras");
  if (extras == nullptr || !extras->is_object()) node["extras"] = Json::object();
  auto& baked = node["extras"]["bakedLight"];
  if (!baked.is_object()) baked = Json::object();
  baked.update(lamp);
}

/// Whether it had any.
bool takeLampsOf(Json& gltf, Json& node, bool is_lit) {
  bool had_any = false;
  for (const auto* kind : kLamps) {
    auto* use = extension(node, kind);
    if (use == nullptr) continue;
    const Json lamp = lampOf(gltf, *use, kind);
    dropExtension(node, kind);
    if (is_lit) keepAsBaked(node, lamp);
    had_any = true;
  }
  return had_any;
}

/// Whether an extension that a pointer of KHR_animation_pointer leads through is no more.
bool leadsNowhere(Json& gltf, const std::string& pointer) {
  constexpr std::string_view kStep = "/extensions/";
  const auto step = pointer.find(kStep);
  if (step == std::string::npos || !pointer.starts_with('/')) return false;
  const auto end = pointer.find('/', step + kStep.size());
  try {
    return !gltf.contains(Json::json_pointer(pointer.substr(0, end)));
  } catch (const Json::exception&) {
    return false;  // no pointer at all
  }
}

bool isDead(Json& gltf, Json& channel) {
  auto* target = member(channel, "target");
  const auto* path = target == nullptr ? nullptr : member(*target, "path");
  if (path == nullptr || !path->is_string()) return false;
  if (auto* use = extension(*target, "KHR_animation_pointer"); use != nullptr) {
    const auto* pointer = member(*use, "pointer");
    return pointer != nullptr && pointer->is_string() && leadsNowhere(gltf, pointer->get<std::string>());
  }
  auto* nodes = member(gltf, "nodes");
  if (nodes == nullptr || !nodes->is_array() || *path != "weights") return false;
  const auto node = indexIn(*target, "node", nodes->size());
  return node && member((*nodes)[*node], "mesh") == nullptr;
}

}  // namespace

void takeHiddenOut(Json& gltf) {
  constexpr const char* kName = "KHR_node_visibility";
  auto* nodes = member(gltf, "nodes");
  if (nodes == nullptr || !nodes->is_array()) return;
  std::vector<std::size_t> roots;
  for (std::size_t i = 0; i < nodes->size(); ++i) {
    auto* of = extension((*nodes)[i], kName);
    const auto* visible = of == nullptr ? nullptr : member(*of, "visible");
    if (visible != nullptr && visible->is_boolean() && !visible->get<bool>()) roots.push_back(i);
    dropExtension((*nodes)[i], kName);
  }
  const auto is_hidden = withAllBelow(*nodes, std::move(roots));
  for (std::size_t i = 0; i < nodes->size(); ++i) {
    auto& node = (*nodes)[i];
    if (!is_hidden[i] || !node.is_object()) continue;
    for (const auto* key : {"mesh", "skin", "weights"}) node.erase(key);
    (void)takeLampsOf(gltf, node, false);
  }
}

std::vector<std::string> takeLightsOut(Json& gltf) {
  std::vector<std::string> names;
  if (auto* nodes = member(gltf, "nodes"); nodes != nullptr && nodes->is_array()) {
    const auto is_lit = nodesOfScene(gltf, *nodes);
    for (std::size_t i = 0; i < nodes->size(); ++i) {
      auto& node = (*nodes)[i];
      if (!takeLampsOf(gltf, node, is_lit[i]) || !is_lit[i]) continue;
      const auto* name = member(node, "name");
      names.push_back(name != nullptr && name->is_string() ? name->get<std::string>() : "node " + std::to_string(i));
    }
  }
  forEachIn(gltf, "scenes", [](Json& scene) {
    for (const auto* kind : kSkies) dropExtension(scene, kind);
  });
  for (const auto* kind : kLamps) dropExtension(gltf, kind);
  for (const auto* kind : kSkies) dropExtension(gltf, kind);
  return names;
}

void takeDeadChannelsOut(Json& gltf) {
  auto* animations = member(gltf, "animations");
  if (animations == nullptr || !animations->is_array()) return;
  const auto lost_all = [&](Json& animation) {
    auto* channels = member(animation, "channels");
    if (channels == nullptr || !channels->is_array()) return false;
    const auto dead = [&](Json& channel) { return isDead(gltf, channel); };
    channels->erase(std::remove_if(channels->begin(), channels->end(), dead), channels->end());
    return channels->empty();
  };
  animations->erase(std::remove_if(animations->begin(), animations->end(), lost_all), animations->end());
  if (animations->empty()) gltf.erase("animations");
}

}  // namespace radiosity::engines
