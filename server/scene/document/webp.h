// WebP bytes to texels (EXT_texture_webp). Pure; any thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::scene {

/// From the first bytes.
[[nodiscard]] bool isWebp(const Bytes& bytes);

/// Width and height, at most 16,383 each, from the header. kUnsupported: an animation, which glTF does not allow.
[[nodiscard]] Result<std::pair<std::uint32_t, std::uint32_t>> sizeOfWebp(const Bytes& bytes, const std::string& where);

/// RGBA, 8 bits a channel, and how many pixels; null: it is broken or cut short. While it works the library takes up to
/// 8 bytes a pixel for itself.
[[nodiscard]] std::unique_ptr<std::uint8_t, void (*)(void*)> decodeWebp(const Bytes& bytes, int& width, int& height);

}  // namespace radiosity::scene
