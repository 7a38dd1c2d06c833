// Scene files before they travel: what kind it is, and a .gltf with its external files packed into it. Pure apart from
// reading the files named.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "common/result.h"

namespace radiosity::cli {

enum class SceneKind { kGlb, kGltf };

/// Looks at the first bytes, not at the name. Errors: no such file, a folder, empty, no permission, neither GLB nor
/// glTF JSON (with a hint for well-known other formats).
[[nodiscard]] Result<SceneKind> sceneKind(const std::string& path);

/// True where a buffer or image of the .gltf lives in another file.
/// The files beside a .gltf that it names, whether or not they are there.
[[nodiscard]] Result<std::vector<std::string>> externalFiles(const std::string& path);
[[nodiscard]] Result<bool> hasExternalFiles(const std::string& path);

/// The .gltf's text with every external buffer and image replaced by a data URI. Only files inside the .gltf's folder
/// are read, links followed first. Errors name the file and the JSON pointer ("room.gltf: /images/2/uri").
[[nodiscard]] Result<std::string> inlineExternalFiles(const std::string& path);

/// RFC 4648, section 4.
[[nodiscard]] std::string base64(std::span<const std::uint8_t> bytes);

}  // namespace radiosity::cli
