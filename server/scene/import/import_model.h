// The typed view of a checked document: tinygltf's Model, with no bytes in it. Buffers and images stay in Document.
// Pure; any thread.
#pragma once

#include <tiny_gltf.h>

#include <vector>

#include "common/result.h"
#include "server/scene/document/document.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {

/// tinygltf on the JSON alone: buffers, images, skins, animations and extras are left out, so it opens no file and
/// decodes no image. Call checkSchema first. Accessors without a buffer view have bufferView == -1, unless they are
/// used as indices: then it is model.bufferViews.size() - 1, an extra view that stands for "all zeros" (tinygltf
/// refuses index accessors without a view). With `before`, what another document was parsed to, of which `former` is
/// the JSON, parts that are the same are taken from there.
[[nodiscard]] Result<tinygltf::Model> parseModel(const Document& document, const Json* former = nullptr,
                                                 const ImportRecord* before = nullptr);

/// Its materials alone.
[[nodiscard]] Result<std::vector<tinygltf::Material>> parseMaterials(const Document& document);

/// The view of an accessor, or null when its values start as zeros.
[[nodiscard]] const tinygltf::BufferView* viewOf(const tinygltf::Model& model, int view);

}  // namespace radiosity::scene
