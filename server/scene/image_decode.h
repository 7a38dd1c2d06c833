// PNG and JPEG bytes to texels, with a budget that is checked before decoding. Pure; any thread.
#pragma once

#include <cstddef>
#include <string>

#include "common/bytes.h"
#include "common/result.h"
#include "server/scene/scene.h"

namespace radiosity::scene {

/// "image/png", "image/jpeg", or "" for anything else, from the first bytes.
[[nodiscard]] std::string sniffImageType(const Bytes& bytes);

/// RGBA, 8 bits a channel. kTooLarge when the header says more than `max_pixels`; nothing is allocated then.
[[nodiscard]] Result<Texture> decodeImage(const Bytes& bytes, std::size_t max_pixels, const std::string& where);

}  // namespace radiosity::scene
