// Compressed geometry of a document (KHR_draco_mesh_compression, EXT_meshopt_compression, KHR_meshopt_compression) is
// decoded when the document is read. From there on it is a document without these extensions: meshes, accessors, nodes
// and materials keep their indices, and what clients see, edit, save and restore holds plain buffers. Pure; any thread.
#pragma once

#include <cstddef>

#include <vector>

#include "common/result.h"
#include "server/scene/document/document.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {

/// Whether a document has such extensions, or lists one. Its JSON may be anything.
[[nodiscard]] bool hasCompressedGeometry(const Json& gltf);

/// Whether a buffer need not be read: all its views are there in compressed form. Its JSON may be anything.
[[nodiscard]] bool isFallbackBuffer(const Json& buffer);

/// By buffer, whether it has no data, but views whose compressed form lies elsewhere. The JSON may be anything.
/// O(views).
[[nodiscard]] std::vector<bool> placesForDecoded(const Json& gltf);

/// Of a checked document whose buffers are there (those without data are empty) and whose images are not. Buffers from
/// `first_buffer` on that held compressed geometry are replaced by one that holds it decoded, and whatever else was in
/// them; those before stay. kTooLarge: decoded it is more than `limits` allow, which is known before it is made; other
/// errors name the view or the primitive. O(bytes).
[[nodiscard]] Result<void> decompressGeometry(Document& document, std::size_t first_buffer, const ImportLimits& limits);

}  // namespace radiosity::scene
