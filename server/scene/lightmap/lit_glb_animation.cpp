#include "server/scene/lightmap/lit_glb_animation.h"

#include <charconv>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace radiosity::scene {
namespace {

constexpr std::string_view kNodes = "/nodes/", kWeights = "/weights";
constexpr const char* kPointer = "/target/extensions/KHR_animation_pointer/pointer";

/// Whose weights a channel animates. Animations are not checked before: anything may stand there.
struct WeightsTarget {
  std::size_t node;
  std::string_view rest;  ///< of a pointer, from "/weights" on; empty: it is target.node
};

std::optional<WeightsTarget> pointedAt(std::string_view pointer) {
  if (!pointer.starts_with(kNodes)) return std::nullopt;
  pointer.remove_prefix(kNodes.size());
  std::size_t node = 0;
  const auto [end, fault] = std::from_chars(pointer.data(), pointer.data() + pointer.size(), node);
  if (fault != std::errc()) return std::nullopt;
  const auto rest = pointer.substr(static_cast<std::size_t>(end - pointer.data()));
  const bool is_weights =
      rest.starts_with(kWeights) && (rest.size() == kWeights.size() || rest[kWeights.size()] == '/');
  return is_weights ? std::optional(WeightsTarget{node, rest}) : std::nullopt;
}

std::optional<WeightsTarget> targetOf(const Json& channel) {
  if (!channel.is_object() || !channel.contains("target") || !channel["target"].is_object()) return std::nullopt;
  const auto& target = channel["target"];
  const auto path = target.find("path");
  if (path == target.end() || !path->is_string()) return std::nullopt;
  const Json::json_pointer pointer(kPointer);
  if (*path == "pointer" && channel.contains(pointer) && channel.at(pointer).is_string())
    return pointedAt(channel.at(pointer).get_ref<const std::string&>());
  const auto node = target.find("node");
  if (*path != "weights" || node == target.end() || !node->is_number_unsigned()) return std::nullopt;
  return WeightsTarget{node->get<std::size_t>(), {}};
}

Json channelOf(const Json& channel, const WeightsTarget& was, std::size_t node) {
  auto moved = channel;
  if (was.rest.empty()) {
    moved["target"]["node"] = node;
  } else {
    moved.at(Json::json_pointer(kPointer)) = std::string(kNodes) + std::to_string(node) + std::string(was.rest);
  }
  return moved;
}

}  // namespace

bool moveWeightChannels(Json& gltf, const std::map<std::size_t, std::vector<std::size_t>>& children,
                        const std::function<bool(std::size_t)>& take) {
  if (children.empty() || !gltf.contains("animations") || !gltf["animations"].is_array()) return true;
  for (auto& animation : gltf["animations"]) {
    if (!animation.is_object() || !animation.contains("channels") || !animation["channels"].is_array()) continue;
    auto before = std::exchange(animation["channels"], Json::array());
    for (auto& channel : before) {
      const auto was = targetOf(channel);
      const auto found = was ? children.find(was->node) : children.end();
      if (found == children.end()) {
        animation["channels"].push_back(std::move(channel));
        continue;
      }
      const auto size = channel.dump(-1, ' ', false, Json::error_handler_t::replace).size();
      if (!take(size * found->second.size())) return false;
      for (const auto child : found->second) animation["channels"].push_back(channelOf(channel, *was, child));
    }
  }
  return true;
}

}  // namespace radiosity::scene
