#include "server/scene/document/decompress.h"

#include <algorithm>
#include <array>
#include <map>
#include <set>
#include <string>
#include <string_view>
#include <tuple>
#include <utility>
#include <vector>

#include "common/task.h"
#include "server/scene/compression/meshopt_view.h"
#include "server/scene/document/decoded_buffer.h"
#include "server/scene/document/decompress_draco.h"

namespace radiosity::scene {
namespace {

/// The second is the first with a later codec, of which our library reads what the first has.
constexpr std::array kMeshoptNames = {"EXT_meshopt_compression", "KHR_meshopt_compression"};
constexpr std::array<std::string_view, 3> kNames = {DracoPrimitives::kName, kMeshoptNames[0], kMeshoptNames[1]};
constexpr std::array kLists = {"extensionsUsed", "extensionsRequired"};

bool isOurs(const Json& name) {
  return name.is_string() && std::ranges::find(kNames, name.get_ref<const std::string&>()) != kNames.end();
}

bool hasOurs(const Json& object) {
  const auto* extensions = memberOf(object, "extensions");
  return extensions != nullptr && std::ranges::any_of(kNames, [&](std::string_view name) {
           return memberOf(*extensions, std::string(name).c_str()) != nullptr;
         });
}

bool anyHasOurs(const Json& owner, const char* list) {
  const auto* entries = memberOf(owner, list);
  return entries != nullptr && entries->is_array() && std::ranges::any_of(*entries, hasOurs);
}

/// The compressed form of a view, and the extension's name; null: there is none.
std::pair<const Json*, const char*> compressedForm(const Json& view) {
  for (const auto* name : kMeshoptNames)
    if (const auto* extension = extensionOf(view, name)) return {extension, name};
  return {nullptr, nullptr};
}

void eraseMeshopt(Json& object) {
  const auto extensions = object.find("extensions");
  if (extensions == object.end()) return;
  for (const auto* name : kMeshoptNames) extensions->erase(name);
  if (extensions->empty()) object.erase(extensions);
}

class Decompressor {
 public:
  Decompressor(Document& document, std::size_t first_buffer, const ImportLimits& limits)
      : document_(document), gltf_(document.gltf), first_(first_buffer), out_(document, limits) {}

  Result<void> run() {
    if (auto ok = decodeViews(); !ok) return ok;
    if (auto ok = decodePrimitives(); !ok) return ok;
    reuseViews();
    if (auto ok = moveRest(); !ok) return ok;
    replaceBuffers();
    dropNames();
    return {};
  }

 private:
  [[nodiscard]] Json& entries(const char* list) {
    static Json none = Json::array();
    return gltf_.contains(list) ? gltf_[list] : none;
  }

  [[nodiscard]] std::string at(const std::string& pointer) const { return place(document_.name, pointer); }

  Result<void> decodeViews() {
    auto& views = entries("bufferViews");
    for (std::size_t i = 0; i < views.size(); ++i) {
      interruptionPoint();
      const auto [extension, name] = compressedForm(views[i]);
      if (extension == nullptr) continue;
      const auto pointer = "/bufferViews/" + std::to_string(i);
      if (auto ok = decodeView(views[i], *extension, at(pointer), at(pointer + "/extensions/" + name)); !ok) return ok;
      eraseMeshopt(views[i]);
    }
    for (auto& buffer : entries("buffers")) {
      // Of data that was not read, be it a file or a data URI, nobody needs the place once all that it holds is
      // decoded.
      if (isFallbackBuffer(buffer)) buffer.erase("uri");
      eraseMeshopt(buffer);
    }
    return {};
  }

  Result<void> decodeView(Json& view, const Json& extension, const std::string& of_view, const std::string& where) {
    MeshoptView form{extension["mode"].get<std::string>(), extension.value("filter", std::string("NONE")),
                     extension["count"].get<std::size_t>(), extension["byteStride"].get<std::size_t>()};
    if (auto ok = checkMeshopt(form, where); !ok) return ok;
    if (view["byteLength"].get<std::size_t>() != form.bytes())
      return fail(ErrorCode::kInvalidScene, "is not the count times the byteStride of its compressed form",
                  of_view + "/byteLength");
    if (view.value("byteStride", form.stride) != form.stride)
      return fail(ErrorCode::kInvalidScene, "is not that of its compressed form", of_view + "/byteStride");
    const auto source = extension["buffer"].get<std::size_t>();
    const auto& buffer = *document_.buffers[source];
    const auto offset = extension.value("byteOffset", std::size_t{0});
    const auto length = extension["byteLength"].get<std::size_t>();
    if (offset > buffer.size() || length > buffer.size() - offset)
      return fail(ErrorCode::kInvalidScene, "the compressed data ends past its buffer", where);
    if (auto ok = out_.claim(form.bytes(), 0, where); !ok) return ok;
    auto bytes = decodeMeshopt(std::span(buffer).subspan(offset, length), form, where);
    if (!bytes) return tl::unexpected(bytes.error());
    left_.insert({source, view["buffer"].get<std::size_t>()});
    out_.put(std::move(*bytes), view);
    return {};
  }

  Result<void> decodePrimitives() {
    auto& meshes = entries("meshes");
    for (std::size_t m = 0; m < meshes.size(); ++m) {
      auto& primitives = meshes[m]["primitives"];
      for (std::size_t p = 0; p < primitives.size(); ++p) {
        interruptionPoint();
        const auto pointer = "/meshes/" + std::to_string(m) + "/primitives/" + std::to_string(p);
        if (auto ok = draco_.decode(primitives[p], pointer); !ok) return ok;
      }
    }
    for (const auto view : draco_.views()) left_.insert(gltf_["bufferViews"][view]["buffer"].get<std::size_t>());
    return {};
  }

  /// A view of a stream that was decoded, and of nothing else, has nothing to name any more.
  void reuseViews() {
    std::set<std::size_t> used;
    const auto use = [&](const Json& object) {
      if (object.contains("bufferView")) used.insert(object["bufferView"].get<std::size_t>());
    };
    for (const auto& accessor : entries("accessors")) {
      use(accessor);
      if (!accessor.contains("sparse")) continue;
      use(accessor["sparse"]["indices"]);
      use(accessor["sparse"]["values"]);
    }
    for (const auto& image : entries("images")) use(image);
    for (const auto view : draco_.views())
      if (!used.contains(view) && isReplaced(gltf_["bufferViews"][view]["buffer"].get<std::size_t>()))
        draco_.reuse(view);
  }

  /// Whether a buffer had compressed data, or none in place of what is decoded now.
  [[nodiscard]] bool isReplaced(std::size_t buffer) const { return buffer >= first_ && left_.contains(buffer); }

  /// What else lies in buffers that are replaced.
  Result<void> moveRest() {
    std::map<std::tuple<std::size_t, std::size_t, std::size_t>, std::size_t> moved;  // many views may name one place
    auto& views = entries("bufferViews");
    for (std::size_t i = 0; i < views.size(); ++i) {
      auto& view = views[i];
      const auto index = view["buffer"].get<std::size_t>();
      if (out_.holds(view) || !isReplaced(index)) continue;
      const auto& buffer = *document_.buffers[index];
      const auto offset = view.value("byteOffset", std::size_t{0}), length = view["byteLength"].get<std::size_t>();
      const auto where = at("/bufferViews/" + std::to_string(i) + "/byteLength");
      if (offset > buffer.size() || length > buffer.size() - offset) {
        return fail(ErrorCode::kInvalidScene,
                    "ends at byte " + std::to_string(offset + length) + " of buffer " + std::to_string(index) +
                        ", which has " + std::to_string(buffer.size()) +
                        (buffer.empty() ? ": all its data is compressed, but not this" : ""),
                    where);
      }
      const auto [known, added] = moved.try_emplace({index, offset, length}, i);
      if (!added) {
        view["byteOffset"] = views[known->second]["byteOffset"];
        view["buffer"] = out_.index();
        continue;
      }
      if (auto ok = out_.claim(length, 0, where); !ok) return ok;
      const auto bytes = std::span(buffer).subspan(offset, length);
      out_.put(Bytes(bytes.begin(), bytes.end()), view);
    }
    return {};
  }

  void replaceBuffers() {
    auto bytes = out_.take();
    if (bytes.empty()) return;
    std::vector<std::size_t> now;  // by their index of before
    std::vector<SharedBytes> buffers;
    Json kept = Json::array();
    for (std::size_t b = 0; b < document_.buffers.size(); ++b) {
      now.push_back(buffers.size());
      if (isReplaced(b)) continue;
      buffers.push_back(std::move(document_.buffers[b]));
      kept.push_back(std::move(gltf_["buffers"][b]));
    }
    now.push_back(buffers.size());
    kept.push_back({{"byteLength", bytes.size()}});
    buffers.push_back(std::make_shared<const Bytes>(std::move(bytes)));
    for (auto& view : gltf_["bufferViews"]) view["buffer"] = now[view["buffer"].get<std::size_t>()];
    gltf_["buffers"] = std::move(kept);
    document_.buffers = std::move(buffers);
  }

  void dropNames() {
    for (const auto* list : kLists) {
      if (!gltf_.contains(list)) continue;
      auto& names = gltf_[list].get_ref<Json::array_t&>();
      std::erase_if(names, isOurs);
      if (names.empty()) gltf_.erase(list);
    }
  }

  Document& document_;
  Json& gltf_;
  std::size_t first_;
  DecodedBuffer out_;
  DracoPrimitives draco_{document_, out_};
  std::set<std::size_t> left_;  ///< buffers that compressed data, or the place for what is decoded, were in
};

}  // namespace

bool hasCompressedGeometry(const Json& gltf) {
  const bool listed = std::ranges::any_of(kLists, [&](const char* list) {
    const auto* names = memberOf(gltf, list);
    return names != nullptr && names->is_array() && std::ranges::any_of(*names, isOurs);
  });
  if (listed || anyHasOurs(gltf, "bufferViews") || anyHasOurs(gltf, "buffers")) return true;
  const auto* meshes = memberOf(gltf, "meshes");
  return meshes != nullptr && meshes->is_array() &&
         std::ranges::any_of(*meshes, [](const Json& mesh) { return anyHasOurs(mesh, "primitives"); });
}

bool isFallbackBuffer(const Json& buffer) {
  const auto* extensions = memberOf(buffer, "extensions");
  return extensions != nullptr && std::ranges::any_of(kMeshoptNames, [&](const char* name) {
           const auto* extension = memberOf(*extensions, name);
           const auto* fallback = extension == nullptr ? nullptr : memberOf(*extension, "fallback");
           return fallback != nullptr && *fallback == true;
         });
}

std::vector<bool> placesForDecoded(const Json& gltf) {
  const auto *buffers = memberOf(gltf, "buffers"), *views = memberOf(gltf, "bufferViews");
  std::vector<bool> places(buffers != nullptr && buffers->is_array() ? buffers->size() : 0, false);
  if (views == nullptr || !views->is_array()) return places;
  for (const auto& view : *views) {
    const auto* of = memberOf(view, "buffer");
    if (of == nullptr || !of->is_number_integer() || of->get<std::uint64_t>() >= places.size() || !hasOurs(view))
      continue;
    const auto buffer = of->get<std::size_t>();
    places[buffer] = memberOf((*buffers)[buffer], "uri") == nullptr;
  }
  return places;
}

Result<void> decompressGeometry(Document& document, std::size_t first_buffer, const ImportLimits& limits) {
  return Decompressor(document, first_buffer, limits).run();
}

}  // namespace radiosity::scene
