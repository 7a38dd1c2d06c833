#include "server/scene/document/scene_limit.h"

#include <fmt/format.h>

#include "common/memory_limit.h"

namespace radiosity::scene {
namespace {

constexpr std::uint64_t kLikelyBytes = std::uint64_t{512} << 20, kLikelyBytesAByte = 128;

std::string inUnits(std::uint64_t bytes) {
  constexpr double kMib = 1048576.0, kGib = 1024.0 * kMib;
  const auto size = static_cast<double>(bytes);
  return size >= kGib ? fmt::format("{:.1f} GiB", size / kGib) : fmt::format("{:.1f} MiB", size / kMib);
}

}  // namespace

std::uint64_t sceneMemoryLimit(const ImportLimits& limits) {
  return limits.max_scene_bytes != 0 ? limits.max_scene_bytes : memoryLimitBytes() / 2;
}

std::uint64_t likelySceneBytes(const ImportLimits& limits, std::uint64_t bytes_of_data) {
  return limits.max_scene_bytes != 0 ? ~std::uint64_t{0} : kLikelyBytes + kLikelyBytesAByte * bytes_of_data;
}

std::string sceneMemoryFault(std::uint64_t bytes, std::uint64_t limit, std::string_view what) {
  return fmt::format("with {} the scene would take {} or more; --max-scene-memory allows {}", what, inUnits(bytes),
                     inUnits(limit));
}

}  // namespace radiosity::scene
