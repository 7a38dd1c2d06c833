#include "server/scene/document/document_uploads.h"

#include "server/scene/document/decompress.h"
#include "server/scene/document/document_uri.h"
#include "server/scene/document/import_schema.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {
namespace {

class Attacher {
 public:
  Attacher(Document& document, const FindUpload& uploads, const ImportLimits& limits)
      : document_(document), uploads_(uploads), limits_(limits), limit_(limits.max_file_bytes) {
    for (const auto* list : {&document.buffers, &document.images}) {
      for (const auto& bytes : *list) used_ += bytes->size();
    }
  }

  Result<void> run() {
    const auto first = document_.buffers.size();
    const bool compressed = hasCompressedGeometry(document_.gltf);
    if (count("buffers") <= first && count("images") <= document_.images.size() && !compressed) return {};
    const auto empty = placesForDecoded(document_.gltf);
    for (auto i = document_.buffers.size(); i < count("buffers"); ++i) {
      auto& entry = document_.gltf["buffers"][i];
      const bool is_empty = isFallbackBuffer(entry) || empty[i];
      auto ok = is_empty ? keep(document_.buffers, std::make_shared<const Bytes>(), at("buffers", i))
                         : buffer(entry, at("buffers", i));
      if (!ok) return ok;
    }
    // Images may name buffer views, which nobody has looked at so far.
    std::vector<std::string> warnings;
    if (auto ok = checkSchema(document_.gltf, document_.name, warnings); !ok) return ok;
    if (compressed)
      if (auto ok = decompressGeometry(document_, first, limits_); !ok) return ok;
    for (auto i = document_.images.size(); i < count("images"); ++i) {
      if (auto ok = image(document_.gltf["images"][i], at("images", i)); !ok) return ok;
    }
    return {};
  }

 private:
  [[nodiscard]] std::size_t count(const char* array) const {
    const auto found = document_.gltf.find(array);
    return found == document_.gltf.end() || !found->is_array() ? 0 : found->size();
  }

  [[nodiscard]] std::string at(const char* array, std::size_t index) const {
    return place(document_.name, std::string("/") + array + "/" + std::to_string(index));
  }

  Result<SharedBytes> fetch(Json& entry, const std::string& where) {
    if (!entry.is_object()) return fail(ErrorCode::kInvalidScene, "must be an object", where);
    const auto found = entry.find("uri");
    if (found == entry.end() || !found->is_string()) {
      return fail(ErrorCode::kInvalidScene, "needs a uri: that of an upload (/uploads/<id>), or a data URI", where);
    }
    const auto uri = found->get<std::string>();
    SharedBytes bytes;
    if (isDataUri(uri)) {
      auto decoded = decodeDataUri(uri, where + "/uri");
      if (!decoded) return tl::unexpected(decoded.error());
      bytes = std::make_shared<const Bytes>(std::move(*decoded));
    } else if (uploads_) {
      bytes = uploads_(uri);
    }
    if (!bytes) {
      return fail(ErrorCode::kNotFound, "there is no upload " + uri.substr(0, 100) + " (any more); PUT it to /uploads",
                  where + "/uri");
    }
    entry.erase("uri");
    return bytes;
  }

  Result<void> keep(std::vector<SharedBytes>& list, SharedBytes bytes, const std::string& where) {
    used_ += bytes->size();
    if (used_ > limit_) {
      return fail(ErrorCode::kTooLarge,
                  "buffers and images would have more than " + std::to_string(limit_) + " bytes in all", where);
    }
    list.push_back(std::move(bytes));
    return {};
  }

  Result<void> buffer(Json& entry, const std::string& where) {
    auto bytes = fetch(entry, where);
    if (!bytes) return tl::unexpected(bytes.error());
    if (!entry.contains("byteLength")) entry["byteLength"] = (*bytes)->size();
    const auto& length = entry["byteLength"];
    if (!length.is_number_unsigned() || length.get<std::uint64_t>() > (*bytes)->size()) {
      return fail(ErrorCode::kInvalidScene, "the data has " + std::to_string((*bytes)->size()) + " bytes",
                  where + "/byteLength");
    }
    return keep(document_.buffers, std::move(*bytes), where);
  }

  Result<void> image(Json& entry, const std::string& where) {
    if (entry.contains("uri") == entry.contains("bufferView"))
      return fail(ErrorCode::kInvalidScene, "must have either uri or bufferView", where);
    if (entry.contains("uri")) {
      auto bytes = fetch(entry, where);
      if (!bytes) return tl::unexpected(bytes.error());
      return keep(document_.images, std::move(*bytes), where);
    }
    const auto& view = document_.gltf["bufferViews"][entry["bufferView"].get<std::size_t>()];
    const auto& bytes = *document_.buffers[view["buffer"].get<std::size_t>()];
    const auto offset = view.value("byteOffset", std::size_t{0});
    const auto length = view["byteLength"].get<std::size_t>();
    if (offset > bytes.size() || length > bytes.size() - offset)
      return fail(ErrorCode::kInvalidScene, "buffer view ends past its buffer", where + "/bufferView");
    const auto* first = bytes.data() + offset;
    return keep(document_.images, std::make_shared<const Bytes>(first, first + length), where);
  }

  Document& document_;
  const FindUpload& uploads_;
  const ImportLimits& limits_;
  std::size_t limit_, used_ = 0;
};

}  // namespace

Result<void> attachUploads(Document& document, const FindUpload& uploads, const ImportLimits& limits) {
  return Attacher(document, uploads, limits).run();
}

}  // namespace radiosity::scene
