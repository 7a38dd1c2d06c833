#include "server/scene/image_decode.h"

#include <stb_image.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/vec2.hpp>
#include <limits>
#include <memory>

#include "server/scene/shade_texture.h"

namespace radiosity::scene {
namespace {

std::string decoderReason() {
  const char* reason = stbi_failure_reason();
  return reason == nullptr ? "unknown reason" : reason;
}

std::uint8_t byteOf(float value, bool srgb) {
  const float coded = !srgb                 ? value
                      : value <= 0.0031308F ? 12.92F * value
                                            : 1.055F * std::pow(value, 1.0F / 2.4F) - 0.055F;
  return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(coded, 0.0F, 1.0F)));
}

/// The mean of a block of pixels.
void average(const Texture& from, const glm::ivec2& low, const glm::ivec2& end, std::uint8_t* out) {
  glm::vec3 plain(0.0F), covered(0.0F);
  float alpha = 0.0F;
  for (int y = low.y; y < end.y; ++y)
    for (int x = low.x; x < end.x; ++x) {
      const auto pixel = pixelOf(from, x, y);
      plain += glm::vec3(pixel);
      covered += glm::vec3(pixel) * pixel.a;
      alpha += pixel.a;
    }
  const auto count = static_cast<float>((end.x - low.x) * (end.y - low.y));
  const auto rgb = from.srgb && alpha > 0.0F ? covered / alpha : plain / count;
  for (int c = 0; c < 3; ++c) out[c] = byteOf(rgb[c], from.srgb);
  out[3] = byteOf(alpha / count, false);
}

Texture halved(const Texture& from) {
  Texture to;
  to.width = std::max(1, from.width / 2);
  to.height = std::max(1, from.height / 2);
  to.srgb = from.srgb;
  to.rgba.resize(std::size_t{4} * static_cast<std::size_t>(to.width) * static_cast<std::size_t>(to.height));
  // Of odd sizes the last pixel takes in one more.
  const auto endOf = [](int i, int size, int all) { return i + 1 == size ? all : 2 * (i + 1); };
  auto* out = to.rgba.data();
  for (int y = 0; y < to.height; ++y)
    for (int x = 0; x < to.width; ++x, out += 4)
      average(from, {2 * x, 2 * y}, {endOf(x, to.width, from.width), endOf(y, to.height, from.height)}, out);
  return to;
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

Result<ImageSize> sizeOfImage(const Bytes& bytes, std::size_t max_pixels, const std::string& where) {
  // stb_image knows more formats, but glTF does not, and they are the less tested ones.
  if (sniffImageType(bytes).empty()) return fail(ErrorCode::kUnsupported, "is neither PNG nor JPEG", where);
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    return fail(ErrorCode::kTooLarge, "image file has more than 2 GiB", where);
  }
  int width = 0, height = 0, channels = 0;
  if (stbi_info_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height, &channels) == 0 ||
      width <= 0 || height <= 0) {
    return fail(ErrorCode::kBadInput, "image header cannot be read: " + decoderReason(), where);
  }
  const ImageSize size{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height)};
  if (size.pixels() > max_pixels) {
    return fail(ErrorCode::kTooLarge,
                "image is " + std::to_string(width) + " x " + std::to_string(height) + "; the limit is " +
                    std::to_string(max_pixels) + " pixels",
                where);
  }
  return size;
}

Result<Texture> decodeImage(const Bytes& bytes, std::size_t max_pixels, const std::string& where) {
  const auto size = sizeOfImage(bytes, max_pixels, where);
  if (!size) return tl::unexpected(size.error());
  int width = 0, height = 0, channels = 0;
  const std::unique_ptr<stbi_uc, void (*)(void*)> rgba(
      stbi_load_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height, &channels, 4),
      stbi_image_free);
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  // The size is checked again: the header scan and the decoder are two readers of one file.
  if (!rgba || pixels != size->pixels()) {
    return fail(ErrorCode::kBadInput, "image cannot be decoded: " + decoderReason(), where);
  }
  Texture texture;
  texture.width = width;
  texture.height = height;
  texture.rgba.assign(rgba.get(), rgba.get() + pixels * 4);
  return texture;
}

void halve(Texture& texture, std::uint32_t times) {
  for (std::uint32_t i = 0; i < times; ++i) texture = halved(texture);
}

}  // namespace radiosity::scene
