#include "server/scene/lightmap/lit_glb_rules.h"

#include <algorithm>
#include <map>
#include <numbers>
#include <string>

namespace radiosity::scene {
namespace {

constexpr std::size_t kMostSets = 16;
constexpr std::size_t kUvBytes = 2 * sizeof(float);
constexpr std::size_t kMaxBytes = std::size_t{1} << 30;
constexpr int kFloat = 5126;
constexpr int kVertexBuffer = 34962;

std::string nameOf(std::size_t set) { return "TEXCOORD_" + std::to_string(set); }

/// One more than the highest set that counts.
std::size_t setsOf(const Json& attributes) {
  std::size_t sets = 0;
  for (std::size_t set = 0; set < kMostSets; ++set)
    if (attributes.contains(nameOf(set))) sets = set + 1;
  return sets;
}

/// Zeros in place of texture coordinates: one accessor for each number of vertices, all of one buffer view.
class Zeros {
 public:
  explicit Zeros(Json& gltf) : gltf_(gltf) {}

  std::size_t accessorFor(std::size_t count) {
    const auto [found, added] = accessors_.try_emplace(count, gltf_["accessors"].size());
    if (added) {
      gltf_["accessors"].push_back({{"componentType", kFloat}, {"count", count}, {"type", "VEC2"}});
    }
    return found->second;
  }

  /// Once all are known.
  Result<void> write(std::size_t buffer, Bytes& bytes) {
    if (accessors_.empty()) return {};
    const std::size_t size = accessors_.rbegin()->first * kUvBytes;
    if (bytes.size() + size > kMaxBytes)
      return fail(ErrorCode::kTooLarge, "the lit scene would have more than 1 GiB of new vertex data");
    auto& views = gltf_["bufferViews"];
    for (const auto& [count, accessor] : accessors_) gltf_["accessors"][accessor]["bufferView"] = views.size();
    views.push_back({{"buffer", buffer},
                     {"byteOffset", bytes.size()},
                     {"byteLength", size},
                     {"byteStride", kUvBytes},
                     {"target", kVertexBuffer}});
    bytes.resize(bytes.size() + size, 0);
    return {};
  }

 private:
  Json& gltf_;
  std::map<std::size_t, std::size_t> accessors_;  ///< by count
};

}  // namespace

Result<void> fillTexcoordGaps(Json& gltf, std::size_t buffer, Bytes& bytes) {
  if (!gltf.contains("meshes")) return {};
  Zeros zeros(gltf);
  for (auto& mesh : gltf["meshes"]) {
    for (auto& primitive : mesh["primitives"]) {
      auto& attributes = primitive["attributes"];
      const auto sets = setsOf(attributes);
      if (sets == 0 || !attributes.contains("POSITION")) continue;
      const auto count = gltf["accessors"][attributes["POSITION"].get<std::size_t>()]["count"].get<std::size_t>();
      for (std::size_t set = 0; set < sets; ++set)
        if (const auto name = nameOf(set); !attributes.contains(name)) attributes[name] = zeros.accessorFor(count);
    }
  }
  return zeros.write(buffer, bytes);
}

void dropIdleCutoffs(Json& gltf) {
  if (!gltf.contains("materials")) return;
  for (auto& material : gltf["materials"])
    if (material.value("alphaMode", "OPAQUE") != "MASK") material.erase("alphaCutoff");
}

void separateCones(Json& gltf) {
  const auto pointer = Json::json_pointer("/extensions/KHR_lights_punctual/lights");
  if (!gltf.contains(pointer)) return;
  for (auto& light : gltf[pointer]) {
    if (!light.contains("spot")) continue;
    auto& spot = light["spot"];
    const double outer = spot.value("outerConeAngle", 0.25 * std::numbers::pi);
    if (spot.value("innerConeAngle", 0.0) >= outer) spot["innerConeAngle"] = outer * (1.0 - 1e-6);
  }
}

}  // namespace radiosity::scene
