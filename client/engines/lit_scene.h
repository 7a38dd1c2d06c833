// A lit scene as servers send it: the GLB and the irradiance of its lightmap pages. Plain values; any thread.
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <vector>

#include "common/bytes.h"
#include "common/image.h"
#include "common/result.h"

namespace radiosity::engines {

using Json = nlohmann::json;

struct LitScene {
  Json gltf;
  Bytes bin;                 ///< of buffer 0
  std::vector<Image> pages;  ///< irradiance, lux; row 0 = v 0
};

/// Reads files that `radiosity save` writes. Errors name the file: it cannot be read, is no GLB with one buffer, is no
/// EXR of R, G and B, or has more than kMostSide pixels along a side. Memory: of the files, and 12 bytes a texel.
[[nodiscard]] Result<LitScene> readLitScene(const std::string& glb_path, const std::vector<std::string>& page_paths);

inline constexpr int kMostSide = 16'384;

/// The GLB of a scene. kTooLarge: past 4 GiB.
[[nodiscard]] Result<Bytes> writeGlb(const Json& gltf, std::span<const std::uint8_t> bin);

}  // namespace radiosity::engines
