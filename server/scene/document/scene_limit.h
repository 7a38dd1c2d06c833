// How much memory a scene may claim, and what is said where it claims more. Pure but for what the machine has; any
// thread.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "server/scene/document/document.h"

namespace radiosity::scene {

/// ImportLimits::max_scene_bytes, or what it is where it is 0: half of the memory there is.
[[nodiscard]] std::uint64_t sceneMemoryLimit(const ImportLimits& limits);

/// Unless a limit is named a scene may claim so much of its server, and so much for each byte of data: a kilobyte can
/// place a million triangles in one place, which nobody wants to see, and no model of some size comes near.
[[nodiscard]] std::uint64_t likelySceneBytes(const ImportLimits& limits, std::uint64_t bytes_of_data);

/// "the scene would take 8.0 GiB, more than the 5.8 GiB that --max-scene-memory allows (...)". `what`: what brings the
/// sum above the limit.
[[nodiscard]] std::string sceneMemoryFault(std::uint64_t bytes, std::uint64_t limit, std::string_view what);

}  // namespace radiosity::scene
