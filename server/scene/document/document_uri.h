// What a glTF URI may be: a data URI, or a file in the scene's own folder. Nothing else is opened.
// Pure but for readFile; any thread.
#pragma once

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::scene {

[[nodiscard]] bool isDataUri(std::string_view uri);

/// base64 or percent-encoded payload. `where` is for the error.
[[nodiscard]] Result<Bytes> decodeDataUri(std::string_view uri, const std::string& where);

/// The file that a relative URI means. Refuses schemes, absolute paths, "..", control characters, and symbolic links
/// that lead out of `folder`.
[[nodiscard]] Result<std::filesystem::path> resolveUri(std::string_view uri, const std::filesystem::path& folder,
                                                       const std::string& where);

/// A regular file of at most `max_bytes`.
[[nodiscard]] Result<Bytes> readFile(const std::filesystem::path& file, std::size_t max_bytes,
                                     const std::string& where);

}  // namespace radiosity::scene
