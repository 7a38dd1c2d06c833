// Small glTF files made in memory, for tests.
#pragma once

#include <cstdint>
#include <cstring>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/scene/document/document.h"
#include "server/scene/document/glb.h"

namespace radiosity::scene::test {

using Json = nlohmann::json;

/// Accessors over one BIN chunk; `gltf` may be edited freely.
struct GltfBuilder {
  Json gltf = {{"asset", {{"version", "2.0"}}}};
  Bytes bin;
  Json extra_buffers = Json::array();  ///< behind that of `bin`

  template <typename T>
  std::size_t accessor(const std::vector<T>& values, int component_type, const std::string& type,
                       std::size_t components) {
    while (bin.size() % 4 != 0) bin.push_back(0);
    const auto first = bin.size();
    bin.resize(first + values.size() * sizeof(T));
    std::memcpy(bin.data() + first, values.data(), values.size() * sizeof(T));
    gltf["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", first}, {"byteLength", values.size() * sizeof(T)}});
    gltf["accessors"].push_back({{"bufferView", gltf["bufferViews"].size() - 1},
                                 {"componentType", component_type},
                                 {"count", values.size() / components},
                                 {"type", type}});
    return gltf["accessors"].size() - 1;
  }
  std::size_t vec3(const std::vector<float>& v) { return accessor(v, 5126, "VEC3", 3); }
  std::size_t vec2(const std::vector<float>& v) { return accessor(v, 5126, "VEC2", 2); }
  std::size_t indices(const std::vector<std::uint16_t>& v) { return accessor(v, 5123, "SCALAR", 1); }

  /// A unit square in XY with two triangles; returns the mesh.
  std::size_t square() {
    const auto positions = vec3({0, 0, 0, 1, 0, 0, 1, 1, 0, 0, 1, 0});
    const auto index = indices({0, 1, 2, 0, 2, 3});
    gltf["meshes"].push_back({{"primitives", {{{"attributes", {{"POSITION", positions}}}, {"indices", index}}}}});
    return gltf["meshes"].size() - 1;
  }
  std::size_t node(Json json) {
    gltf["nodes"].push_back(std::move(json));
    return gltf["nodes"].size() - 1;
  }
  [[nodiscard]] Bytes glb() const {
    auto json = gltf;
    if (!bin.empty()) json["buffers"] = Json::array({{{"byteLength", bin.size()}}});
    for (const auto& buffer : extra_buffers) json["buffers"].push_back(buffer);
    return joinGlb(json.dump(), bin);
  }
  [[nodiscard]] Result<Document> document() const { return parseDocument("test.glb", glb()); }
  [[nodiscard]] Result<Scene> scene(const ImportLimits& limits = {}) const {
    const auto parsed = parseDocument("test.glb", glb(), limits);
    if (!parsed) return tl::unexpected(parsed.error());
    return importScene(*parsed, limits);
  }
};

/// Of bytes as they are.
inline std::string dataUri(const std::string& bytes) {
  constexpr const char* kDigits = "0123456789ABCDEF";
  std::string uri = "data:application/octet-stream,";
  for (const char byte : bytes) {
    const auto value = static_cast<unsigned char>(byte);
    uri += {'%', kDigits[value >> 4U], kDigits[value & 15U]};
  }
  return uri;
}

}  // namespace radiosity::scene::test
