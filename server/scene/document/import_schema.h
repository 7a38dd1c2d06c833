// The shape of glTF JSON: which members we read, their types, ranges and what they index. Checked before any other code
// looks at a document, because tinygltf truncates integers silently and skips what has the wrong type.
// Pure functions; any thread.
#pragma once

#include <string>
#include <vector>

#include "common/result.h"
#include "server/scene/document/json_text.h"

namespace radiosity::scene {

/// Every number in range (finite in 32-bit float), every index inside its array, every required member there. Oddities
/// that do no harm go to `warnings`.
[[nodiscard]] Result<void> checkSchema(const Json& gltf, const std::string& name, std::vector<std::string>& warnings);

/// The same of its materials alone, where all else is known to be in order.
[[nodiscard]] Result<void> checkMaterials(const Json& gltf, const std::string& name,
                                          std::vector<std::string>& warnings);

/// Refuses by name what is in extensionsRequired and not supported; warns about the rest of extensionsUsed.
[[nodiscard]] Result<void> checkExtensions(const Json& gltf, const std::string& name,
                                           std::vector<std::string>& warnings);

}  // namespace radiosity::scene
