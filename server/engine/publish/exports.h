// Finished results as files in memory: OpenEXR lightmaps, PNG pictures, tone mapping. Pure functions.
#pragma once

#include "common/bytes.h"
#include "common/image.h"
#include "common/result.h"
#include "server/engine/engine.h"

namespace radiosity::engine {

/// 32-bit float RGB, ZIP compressed, row 0 first; header attribute "unit" says quantity and unit.
[[nodiscard]] Result<Bytes> encodeExr(const Image& values, Quantity quantity = Quantity::kIrradiance);
/// The same with one channel "Y" of 32-bit whole numbers.
[[nodiscard]] Result<Bytes> encodeExr(const IdImage& ids, Quantity quantity);

/// Exposes, maps with the Khronos PBR neutral curve (hue-preserving, near-linear up to 0.8) and encodes as sRGB.
[[nodiscard]] Image toneMap(const Image& radiance, float exposure);

/// An image already in [0, 1] and sRGB-encoded, moved by less than half an 8-bit step, evenly in every square of 8 x 8
/// pixels: light that changes by less than a step over a wall has no contours then. What lies on a step stays there.
[[nodiscard]] Image dithered(Image display);

/// 8-bit RGB PNG of an image already in [0, 1] and sRGB-encoded.
[[nodiscard]] Bytes encodePng(const Image& display);

}  // namespace radiosity::engine
