// The glTF document: the JSON that clients see and edit, and the immutable buffers and images it refers to.
// A value: copies are cheap (buffers are shared). Owned by the engine's solve thread; const copies go anywhere.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "common/bytes.h"
#include "common/result.h"
#include "server/scene/document/touched_parts.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// Bounds on what a file may make us allocate; checked before use.
struct ImportLimits {
  std::size_t max_json_depth = 64;
  std::size_t max_file_bytes = std::size_t{1} << 30;
  std::size_t max_image_pixels = std::size_t{1} << 26;  ///< each image
  std::size_t max_vertices = std::size_t{1} << 26;      ///< all accessors together
  std::size_t max_triangles = std::size_t{1} << 24;     ///< after instancing
  std::size_t max_nodes = std::size_t{1} << 20;
  /// All that a scene claims, about, summed up before it is made; 0: a quarter of the memory there is, and no more than
  /// is likely of so much data.
  std::uint64_t max_scene_bytes = 0;
  std::size_t renderers = 1;  ///< processes beside this one that hold what is drawn
};

struct ImportRecord;  // import_record.h

struct Document {
  std::string name;                  ///< for messages: "room.glb"
  nlohmann::json gltf;               ///< defaults materialised, `matrix` turned into TRS (protocol.md)
  std::vector<SharedBytes> buffers;  ///< one for each /buffers entry
  std::vector<SharedBytes> images;   ///< encoded bytes (PNG, JPEG, WebP), one for each /images entry
  /// Of `gltf` as it is, by importEdited(); null: not known, or too large. Whoever changes `gltf` lets it go.
  std::shared_ptr<const ImportRecord> imported = {};
};

/// Reads .glb or .gltf. External buffers and images are read from the file's own folder and nowhere above it.
[[nodiscard]] Result<Document> loadDocument(const std::filesystem::path& file, const ImportLimits& limits = {});

/// The same from memory (an upload): only data URIs and the GLB chunk can be used.
[[nodiscard]] Result<Document> parseDocument(std::string name, std::span<const std::uint8_t> bytes,
                                             const ImportLimits& limits = {});

/// Every index, offset, count and string is checked here; errors carry file, JSON pointer and reason.
[[nodiscard]] Result<Scene> importScene(const Document& document, const ImportLimits& limits = {});

/// The bytes behind "/uploads/<id>"; null where there is no such upload (any more).
using FindUpload = std::function<SharedBytes(const std::string& uri)>;

/// RFC 6902 on a copy, then validated by the caller with importScene. Pointers may name things:
/// /nodes/@lamp/translation. Buffers and images that the patch appends get their bytes from data URIs, from `uploads`,
/// or (images) from a buffer view.
[[nodiscard]] Result<Document> applyPatch(const Document& document, const nlohmann::json& patch,
                                          const FindUpload& uploads = {}, const ImportLimits& limits = {});

/// A document that has been edited, and the scene that it describes.
struct EditedDocument {
  Document document;
  Scene scene;
  TouchedParts parts = {};  ///< that may be others than in the document before the edit
};

/// importScene on a document that was made from `former`, if from any: what of its JSON is as it was there is not
/// parsed again, no image is decoded twice, and where nothing but materials differs the rest of the scene is that of
/// before, not a copy. The same scene, or the same error, where `limits` are those of before. `parts`: of which alone
/// it need be looked whether they differ.
[[nodiscard]] Result<EditedDocument> importEdited(Document document, const Document* former,
                                                  const ImportLimits& limits = {}, const TouchedParts& parts = {});

/// applyPatch and importEdited in one. `where` of an error is the JSON pointer alone; `operation` is the one that
/// failed, or the one whose path lies nearest to what makes the result no scene.
[[nodiscard]] Result<EditedDocument> editDocument(const Document& document, const nlohmann::json& patch,
                                                  const FindUpload& uploads = {}, const ImportLimits& limits = {});

/// The document as one GLB file (JSON chunk + one BIN chunk; buffers and images embedded). kTooLarge: more than 4 GiB,
/// of which a GLB cannot tell the length.
[[nodiscard]] Result<Bytes> writeGlb(const Document& document);

}  // namespace radiosity::scene
