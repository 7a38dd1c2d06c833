// 8-bit pixels as PNG (ISO/IEC 15948), made in bands on all cores, so that a large picture can be called off between
// two of them. Pure; any thread.
#pragma once

#include <cstdint>
#include <span>

#include "common/bytes.h"

namespace radiosity::scene {

/// `pixels`: width x height x channels bytes, row 0 at the top; 3 channels are RGB, 4 RGBA, both in sRGB. The same
/// bytes on any machine with the same zlib. About 40 ns a pixel and core. Throws std::bad_alloc.
[[nodiscard]] Bytes encodePng(int width, int height, int channels, std::span<const std::uint8_t> pixels);

}  // namespace radiosity::scene
