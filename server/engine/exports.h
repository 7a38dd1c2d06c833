// Finished results as files in memory: OpenEXR lightmaps, PNG pictures, tone mapping and framing. Pure functions.
#pragma once

#include <string>

#include "common/bytes.h"
#include "common/image.h"
#include "common/result.h"
#include "server/scene/scene.h"

namespace radiosity::engine {

/// 32-bit float RGB, ZIP compressed, row 0 first; header attribute "unit" says lux.
[[nodiscard]] Result<Bytes> encodeExr(const Image& irradiance);

/// 8-bit RGB PNG of an image already in [0, 1] and sRGB-encoded.
[[nodiscard]] Result<Bytes> encodePng(const Image& display);

/// The factor that brings the logarithmic mean of the lit pixels to middle grey (0.18); 1 when nothing is lit.
[[nodiscard]] float autoExposure(const Image& radiance);

/// Exposes, maps with the Khronos PBR neutral curve (hue-preserving, near-linear up to 0.8) and encodes as sRGB.
[[nodiscard]] Image toneMap(const Image& radiance, float exposure);

/// The camera of that name or index; empty: the scene's first camera, or one that frames what the scene holds.
[[nodiscard]] Result<scene::Camera> chooseCamera(const scene::Scene& scene, const std::string& wanted);

}  // namespace radiosity::engine
