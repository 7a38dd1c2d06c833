#include "server/scene/image_decode.h"

#include <stb_image.h>

#include <algorithm>
#include <array>
#include <limits>
#include <memory>

namespace radiosity::scene {
namespace {

std::string decoderReason() {
  const char* reason = stbi_failure_reason();
  return reason == nullptr ? "unknown reason" : reason;
}

}  // namespace

std::string sniffImageType(const Bytes& bytes) {
  constexpr std::array<std::uint8_t, 8> kPng = {0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A};
  constexpr std::array<std::uint8_t, 3> kJpeg = {0xFF, 0xD8, 0xFF};
  const auto starts = [&](const auto& magic) {
    return bytes.size() >= magic.size() && std::equal(magic.begin(), magic.end(), bytes.begin());
  };
  if (starts(kPng)) return "image/png";
  if (starts(kJpeg)) return "image/jpeg";
  return "";
}

Result<Texture> decodeImage(const Bytes& bytes, std::size_t max_pixels, const std::string& where) {
  // stb_image knows more formats, but glTF does not, and they are the less tested ones.
  if (sniffImageType(bytes).empty()) return fail(ErrorCode::kUnsupported, "is neither PNG nor JPEG", where);
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    return fail(ErrorCode::kTooLarge, "image file has more than 2 GiB", where);
  }
  const auto length = static_cast<int>(bytes.size());
  int width = 0;
  int height = 0;
  int channels = 0;
  if (stbi_info_from_memory(bytes.data(), length, &width, &height, &channels) == 0 || width <= 0 || height <= 0) {
    return fail(ErrorCode::kBadInput, "image header cannot be read: " + decoderReason(), where);
  }
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  if (pixels > max_pixels) {
    return fail(ErrorCode::kTooLarge,
                "image is " + std::to_string(width) + " x " + std::to_string(height) + "; the limit is " +
                    std::to_string(max_pixels) + " pixels",
                where);
  }
  const std::unique_ptr<stbi_uc, void (*)(void*)> rgba(
      stbi_load_from_memory(bytes.data(), length, &width, &height, &channels, 4), stbi_image_free);
  // The size is checked again: the header scan and the decoder are two readers of one file.
  if (!rgba || static_cast<std::size_t>(width) * static_cast<std::size_t>(height) != pixels) {
    return fail(ErrorCode::kBadInput, "image cannot be decoded: " + decoderReason(), where);
  }
  Texture texture;
  texture.width = width;
  texture.height = height;
  texture.rgba.assign(rgba.get(), rgba.get() + pixels * 4);
  return texture;
}

}  // namespace radiosity::scene
