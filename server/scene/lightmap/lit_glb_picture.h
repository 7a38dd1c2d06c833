// Lightmap pages as PNGs for the unlit export.
#pragma once

#include <cstdint>

#include "common/bytes.h"
#include "common/image.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// One page, sRGB-encoded by the caller, values in [0, 1]. Where surfaces that one can see through lie on it, it has
/// their opacity as alpha, and as many pixels across a texel as their alpha textures ask for, up to kMostPixels along a
/// side.
[[nodiscard]] Bytes encodePagePng(const PatchScene& patches, std::uint32_t page, const Image& display);

inline constexpr std::uint32_t kMostPixels = 4096;

}  // namespace radiosity::scene
