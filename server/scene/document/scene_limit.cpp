#include "server/scene/document/scene_limit.h"

#include <fmt/format.h>

#include <tuple>

#include "common/memory_limit.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {
namespace {

constexpr std::uint64_t kLikelyBytes = std::uint64_t{512} << 20, kLikelyBytesAByte = 128;
/// Bytes, measured at the peak of loading scenes of 10,000 to 160,000 of each: JSON with its defaults, a copy of it as
/// the parser wants it, and what the parser makes of that.
constexpr std::uint64_t kNodeBytes = 3'000, kMaterialBytes = 9'000, kMeshBytes = 2'000, kAccessorBytes = 1'500;
constexpr std::uint64_t kEntryBytes = 16;  ///< of JSON, at least, that places something

std::uint64_t countOf(const Document& document, const char* list) {
  return document.gltf.contains(list) ? document.gltf[list].size() : 0;
}

std::uint64_t countOfPrimitives(const Document& document) {
  std::uint64_t count = 0;
  if (document.gltf.contains("meshes"))
    for (const auto& mesh : document.gltf["meshes"]) count += mesh["primitives"].size();
  return count;
}

std::string inUnits(std::uint64_t bytes) {
  constexpr double kMib = 1048576.0, kGib = 1024.0 * kMib;
  const auto size = static_cast<double>(bytes);
  return size >= kGib ? fmt::format("{:.1f} GiB", size / kGib) : fmt::format("{:.1f} MiB", size / kMib);
}

}  // namespace

SceneLimit sceneMemoryLimit(const ImportLimits& limits) {
  if (limits.max_scene_bytes != 0) return {limits.max_scene_bytes, SceneLimit::Source::kOption};
  return {memoryLimitBytes() / 4, SceneLimit::Source::kMemory};
}

SceneLimit likelySceneMemory(const ImportLimits& limits, std::uint64_t bytes_of_data) {
  if (limits.max_scene_bytes != 0) return {~std::uint64_t{0}, SceneLimit::Source::kOption};
  return {kLikelyBytes + kLikelyBytesAByte * bytes_of_data, SceneLimit::Source::kData};
}

std::string sceneMemoryFault(std::uint64_t bytes, const SceneLimit& limit, std::string_view what) {
  const auto too_much = fmt::format("with {} the scene would take {} or more; ", what, inUnits(bytes));
  const auto most = inUnits(limit.bytes);
  if (limit.source == SceneLimit::Source::kOption) return too_much + "--max-scene-memory allows " + most;
  const auto* why =
      limit.source == SceneLimit::Source::kMemory ? "a quarter of the memory there is" : "for so few bytes of data";
  return too_much + fmt::format("the limit is {}, {}, unless --max-scene-memory names another", most, why);
}

std::uint64_t bytesOfData(const Document& document) {
  std::uint64_t entries = countOfPrimitives(document);
  for (const auto* list : {"meshes", "accessors"}) entries += countOf(document, list);
  if (document.gltf.contains("nodes"))
    for (const auto& node : document.gltf["nodes"]) entries += node.contains("mesh") ? 1 : 0;
  std::uint64_t bytes = kEntryBytes * entries;
  for (const auto& buffer : document.buffers) bytes += buffer ? buffer->size() : 0;
  return bytes;
}

Result<std::uint64_t> claimOfJson(const Document& document, const ImportLimits& limits) {
  const auto limit = sceneMemoryLimit(limits), likely = likelySceneMemory(limits, bytesOfData(document));
  std::uint64_t bytes = 0;
  for (const auto& [pointer, entries, each] :
       {std::tuple("/nodes", countOf(document, "nodes"), kNodeBytes),
        std::tuple("/materials", countOf(document, "materials"), kMaterialBytes),
        std::tuple("/meshes", countOf(document, "meshes") + countOfPrimitives(document), kMeshBytes),
        std::tuple("/accessors", countOf(document, "accessors"), kAccessorBytes)}) {
    bytes += entries * each;
    for (const auto& most : {likely, limit})
      if (bytes > most.bytes)
        return fail(ErrorCode::kTooLarge, sceneMemoryFault(bytes, most, "its entries"), place(document.name, pointer));
  }
  return bytes;
}

}  // namespace radiosity::scene
