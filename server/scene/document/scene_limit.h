// How much memory a scene may claim, what its JSON claims, and what is said where that is more. Pure but for what the
// machine has; any thread.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "common/result.h"
#include "server/scene/document/document.h"

namespace radiosity::scene {

struct SceneLimit {
  enum class Source { kOption, kMemory, kData };

  std::uint64_t bytes = 0;
  Source source = Source::kOption;  ///< of the number: who is refused has to know what would change it
};

/// ImportLimits::max_scene_bytes, or what it is where it is 0: a quarter of the memory there is.
[[nodiscard]] SceneLimit sceneMemoryLimit(const ImportLimits& limits);

/// Unless a limit is named a scene may claim so much of its server, and so much for each byte of data: a kilobyte can
/// place a million triangles in one place, which nobody wants to see, and no model of some size comes near.
[[nodiscard]] SceneLimit likelySceneMemory(const ImportLimits& limits, std::uint64_t bytes_of_data);

/// "with its vertices the scene would take 8.0 GiB or more; --max-scene-memory allows 5.8 GiB", or what else the limit
/// comes from, and that the option takes its place. `what`: what brings the sum above the limit.
[[nodiscard]] std::string sceneMemoryFault(std::uint64_t bytes, const SceneLimit& limit, std::string_view what);

/// For likelySceneMemory(): the bytes of a checked document's buffers, and a few for each entry of its JSON that places
/// something. O(meshes + nodes).
[[nodiscard]] std::uint64_t bytesOfData(const Document& document);

/// Bytes that parsing a checked document takes, about: entries of the JSON's lists. kTooLarge: they are more than the
/// limit, or than is likely of so few bytes of data. O(meshes + nodes).
[[nodiscard]] Result<std::uint64_t> claimOfJson(const Document& document, const ImportLimits& limits);

}  // namespace radiosity::scene
