// PNG, JPEG and WebP bytes to texels, with a budget that is checked before decoding. Pure; any thread.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "common/bytes.h"
#include "common/result.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// "image/png", "image/jpeg", "image/webp", or "" for anything else, from the first bytes.
[[nodiscard]] std::string sniffImageType(const Bytes& bytes);

struct ImageSize {
  std::uint32_t width = 0, height = 0;

  [[nodiscard]] std::uint64_t pixels() const { return std::uint64_t{width} * height; }
  /// Halved so often, one pixel at least.
  [[nodiscard]] ImageSize halved(std::uint32_t times) const {
    return {std::max(1U, width >> times), std::max(1U, height >> times)};
  }
};
/// From the header. kTooLarge: more than `max_pixels`, of 16 bits a channel half as many, or more scans than any honest
/// JPEG has; kUnsupported and kBadInput: it is no PNG, JPEG or WebP.
[[nodiscard]] Result<ImageSize> sizeOfImage(const Bytes& bytes, std::size_t max_pixels, const std::string& where);

/// How a picture is held.
struct ImageUse {
  bool srgb = false;
  std::uint32_t halvings = 0;  ///< as halve()
};
/// RGBA, 8 bits a channel. kTooLarge as sizeOfImage(); nothing is allocated then. While it
/// works there is 4 bytes for each of the file's pixels, and what the decoder needs for itself.
[[nodiscard]] Result<Texture> decodeImage(const Bytes& bytes, std::size_t max_pixels, const std::string& where,
                                          const ImageUse& use = {});

/// Width and height halved so often (ImageSize::halved): each pixel is the mean of those below it, in linear light
/// where Texture::srgb, and weighted by their alpha, since colour behind what is cut out says nothing. O(pixels).
void halve(Texture& texture, std::uint32_t times);

}  // namespace radiosity::scene
