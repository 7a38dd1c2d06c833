// A step of the exporters: animations of nodes that became several. Pure; any thread.
#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <vector>

#include "server/scene/document/json_text.h"

namespace radiosity::scene {

/// The mesh of a node (key) is its children's now: what animates the node's morph weights, by itself or through
/// KHR_animation_pointer, animates theirs instead, by the same samplers. `take`: counts bytes of JSON that is there
/// again, and returns whether there is room for them. False: there is none, and `gltf` is of no use.
[[nodiscard]] bool moveWeightChannels(Json& gltf, const std::map<std::size_t, std::vector<std::size_t>>& children,
                                      const std::function<bool(std::size_t)>& take);

}  // namespace radiosity::scene
