// Reading a document: container, JSON, buffers and images. What the JSON says about them is judged by import_schema
// first; what it says about geometry by importScene.
#include "server/scene/document/document.h"

#include <algorithm>
#include <optional>

#include "server/scene/document/decompress.h"
#include "server/scene/document/document_defaults.h"
#include "server/scene/document/document_uri.h"
#include "server/scene/document/glb.h"
#include "server/scene/document/import_schema.h"
#include "server/scene/document/scene_limit.h"

namespace radiosity::scene {
namespace {

using OptionalFolder = std::optional<std::filesystem::path>;

/// Fills Document::buffers and ::images from a checked JSON.
class Loader {
 public:
  Loader(Document& document, const GlbChunks& chunks, OptionalFolder folder, const ImportLimits& limits)
      : document_(document),
        chunks_(chunks),
        folder_(std::move(folder)),
        limits_(limits),
        bytes_left_(limits.max_file_bytes),
        image_bytes_left_(limits.max_file_bytes) {}

  Result<void> run() {
    for (std::size_t i = 0; i < count("buffers"); ++i) {
      auto bytes = buffer(document_.gltf["buffers"][i], i);
      if (!bytes) return tl::unexpected(bytes.error());
      document_.buffers.push_back(std::make_shared<const Bytes>(std::move(*bytes)));
    }
    if (hasCompressedGeometry(document_.gltf))
      if (auto ok = decompressGeometry(document_, 0, limits_); !ok) return ok;
    for (std::size_t i = 0; i < count("images"); ++i) {
      auto bytes = image(document_.gltf["images"][i], i);
      if (!bytes) return tl::unexpected(bytes.error());
      document_.images.push_back(std::make_shared<const Bytes>(std::move(*bytes)));
    }
    if (auto ok = photometricFiles(); !ok) return ok;
    return skyPicture();
  }

 private:
  [[nodiscard]] std::size_t count(const char* array) const {
    const auto found = document_.gltf.find(array);
    return found == document_.gltf.end() ? 0 : found->size();
  }

  [[nodiscard]] std::string at(const char* array, std::size_t index, const char* member = "") const {
    return place(document_.name, std::string("/") + array + "/" + std::to_string(index) + member);
  }

  /// Bytes of `uri`; a data URI is taken out of the JSON, for clients read that and the bytes are held beside it.
  Result<Bytes> fetch(Json& object, const std::string& where) {
    const auto uri = object["uri"].get<std::string>();
    if (isDataUri(uri)) {
      object.erase("uri");
      return decodeDataUri(uri, where);
    }
    if (!folder_)
      return fail(ErrorCode::kBadInput, "refers to a file; an upload must be one GLB or use data URIs", where);
    const auto file = resolveUri(uri, *folder_, where);
    if (!file) return tl::unexpected(file.error());
    auto bytes = readFile(*file, bytes_left_, where);
    if (bytes) bytes_left_ -= bytes->size();
    return bytes;
  }

  Result<Bytes> buffer(Json& entry, std::size_t index) {
    const auto length = entry["byteLength"].get<std::size_t>();
    if (isFallbackBuffer(entry)) return Bytes();
    Result<Bytes> bytes;
    if (entry.contains("uri")) {
      bytes = fetch(entry, at("buffers", index, "/uri"));
      if (!bytes) return bytes;
    } else if (index == 0 && chunks_.has_bin) {
      bytes = Bytes(chunks_.bin.begin(), chunks_.bin.end());
    } else {
      return Bytes();  // allowed where nothing refers to it; any view into it is refused by its bounds
    }
    if (bytes->size() < length) {
      return fail(
          ErrorCode::kBadInput,
          "is " + std::to_string(length) + ", but the data has only " + std::to_string(bytes->size()) + " bytes",
          at("buffers", index, "/byteLength"));
    }
    bytes->resize(length);
    return bytes;
  }

  Result<Bytes> image(Json& entry, std::size_t index) {
    if (entry.contains("uri") == entry.contains("bufferView")) {
      return fail(ErrorCode::kInvalidScene, "must have either uri or bufferView", at("images", index));
    }
    if (entry.contains("uri")) return fetch(entry, at("images", index, "/uri"));
    const auto& view = document_.gltf["bufferViews"][entry["bufferView"].get<std::size_t>()];
    const auto& bytes = *document_.buffers[view["buffer"].get<std::size_t>()];
    const auto offset = view.value("byteOffset", std::size_t{0});
    const auto length = view["byteLength"].get<std::size_t>();
    if (offset > bytes.size() || length > bytes.size() - offset) {
      return fail(ErrorCode::kInvalidScene, "buffer view ends past its buffer", at("images", index, "/bufferView"));
    }
    if (length > image_bytes_left_) {  // many images may name one view
      return fail(ErrorCode::kTooLarge, "images have more bytes than a file may have", at("images", index));
    }
    image_bytes_left_ -= length;
    const auto* first = bytes.data() + offset;
    return Bytes(first, first + length);
  }

  /// Those of EXT_lights_ies that lie in files, or in data URIs, get a buffer each: a document has no bytes elsewhere.
  Result<void> photometricFiles() {
    const auto pointer = Json::json_pointer("/extensions/EXT_lights_ies/lights");
    if (!document_.gltf.contains(pointer)) return {};
    for (std::size_t i = 0; i < document_.gltf.at(pointer).size(); ++i) {
      auto& light = document_.gltf.at(pointer)[i];
      if (!light.contains("uri") || light.contains("bufferView")) continue;
      auto bytes = fetch(light, place(document_.name, pointer.to_string() + "/" + std::to_string(i) + "/uri"));
      if (!bytes) return tl::unexpected(bytes.error());
      if (bytes->empty()) return fail(ErrorCode::kInvalidScene, "is empty", place(document_.name, pointer.to_string()));
      if (!light.contains("mimeType")) {
        const bool is_ies =
            std::string_view(reinterpret_cast<const char*>(bytes->data()), bytes->size()).find("TILT=") !=
            std::string_view::npos;
        light["mimeType"] = is_ies ? "application/x-ies-lm-63" : "application/x-eulumdat";
      }
      moveToBuffer(light, std::move(*bytes));
    }
    return {};
  }

  /// The same for the picture of /extras/radiositySky.
  Result<void> skyPicture() {
    const auto pointer = Json::json_pointer("/extras/radiositySky");
    if (!document_.gltf.contains(pointer)) return {};
    auto& sky = document_.gltf.at(pointer);
    if (!sky.is_object() || !sky.contains("uri") || !sky["uri"].is_string() || sky.contains("bufferView")) return {};
    const auto where = place(document_.name, pointer.to_string() + "/uri");
    auto bytes = fetch(sky, where);
    if (!bytes) return tl::unexpected(bytes.error());
    if (bytes->empty()) return fail(ErrorCode::kInvalidScene, "is empty", where);
    moveToBuffer(sky, std::move(*bytes));
    return {};
  }

  /// What an object had a URI for lies in a buffer, and a view of all of it.
  void moveToBuffer(Json& object, Bytes bytes) {
    object.erase("uri");
    object["bufferView"] = count("bufferViews");
    const Json view{{"buffer", count("buffers")}, {"byteLength", bytes.size()}};
    const Json buffer{{"byteLength", bytes.size()}};
    document_.gltf["bufferViews"].push_back(view);
    document_.gltf["buffers"].push_back(buffer);
    document_.buffers.push_back(std::make_shared<const Bytes>(std::move(bytes)));
  }

  Document& document_;
  const GlbChunks& chunks_;
  OptionalFolder folder_;
  const ImportLimits& limits_;
  std::size_t bytes_left_;
  std::size_t image_bytes_left_;
};

Result<Document> parse(std::string name, std::span<const std::uint8_t> bytes, const OptionalFolder& folder,
                       const ImportLimits& limits) {
  if (bytes.size() > limits.max_file_bytes) {
    return fail(ErrorCode::kTooLarge,
                "has " + std::to_string(bytes.size()) + " bytes; the limit is " + std::to_string(limits.max_file_bytes),
                name);
  }
  GlbChunks chunks;
  if (isGlb(bytes)) {
    auto split = splitGlb(name, bytes);
    if (!split) return tl::unexpected(split.error());
    chunks = *split;
  } else {
    chunks.json = {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  auto json = parseJson(chunks.json, name, limits.max_json_depth);
  if (!json) return tl::unexpected(json.error());
  Document document;
  document.name = std::move(name);
  document.gltf = std::move(*json);
  std::vector<std::string> warnings;  // importScene finds them again
  if (auto ok = checkSchema(document.gltf, document.name, warnings); !ok) return tl::unexpected(ok.error());
  if (auto ok = checkExtensions(document.gltf, document.name, warnings); !ok) return tl::unexpected(ok.error());
  if (auto ok = Loader(document, chunks, folder, limits).run(); !ok) return tl::unexpected(ok.error());
  // Defaults take a hundred times what an empty entry has in the file.
  if (const auto claimed = claimOfJson(document, limits); !claimed) return tl::unexpected(claimed.error());
  materialiseDefaults(document.gltf);
  return document;
}

}  // namespace

Result<Document> loadDocument(const std::filesystem::path& file, const ImportLimits& limits) {
  const auto name = file.filename().string();
  auto bytes = readFile(file, limits.max_file_bytes, file.string());
  if (!bytes) return tl::unexpected(bytes.error());
  return parse(name, *bytes, file.parent_path(), limits);
}

Result<Document> parseDocument(std::string name, std::span<const std::uint8_t> bytes, const ImportLimits& limits) {
  return parse(std::move(name), bytes, std::nullopt, limits);
}

}  // namespace radiosity::scene
