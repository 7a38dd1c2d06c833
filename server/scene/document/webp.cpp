#include "server/scene/document/webp.h"

#include <webp/decode.h>

#include <algorithm>
#include <span>
#include <string_view>

namespace radiosity::scene {

bool isWebp(const Bytes& bytes) {
  constexpr std::string_view kContainer = "RIFF", kFormat = "WEBP";
  constexpr std::ptrdiff_t kFormatAt = 8;
  return bytes.size() >= kFormatAt + kFormat.size() && std::ranges::equal(kContainer, std::span(bytes).first(4)) &&
         std::ranges::equal(kFormat, std::span(bytes).subspan(kFormatAt, kFormat.size()));
}

Result<std::pair<std::uint32_t, std::uint32_t>> sizeOfWebp(const Bytes& bytes, const std::string& where) {
  WebPBitstreamFeatures features;
  if (WebPGetFeatures(bytes.data(), bytes.size(), &features) != VP8_STATUS_OK || features.width <= 0 ||
      features.height <= 0)
    return fail(ErrorCode::kBadInput, "image header cannot be read: it is no sound WebP", where);
  if (features.has_animation != 0) return fail(ErrorCode::kUnsupported, "is an animated WebP", where);
  return std::pair{static_cast<std::uint32_t>(features.width), static_cast<std::uint32_t>(features.height)};
}

std::unique_ptr<std::uint8_t, void (*)(void*)> decodeWebp(const Bytes& bytes, int& width, int& height) {
  return {WebPDecodeRGBA(bytes.data(), bytes.size(), &width, &height), WebPFree};
}

}  // namespace radiosity::scene
