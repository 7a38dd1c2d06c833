#include "server/scene/document/image_decode.h"

#include <stb_image.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/vec2.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "common/parallel.h"
#include "common/task.h"
#include "server/scene/document/webp.h"
#include "server/scene/values/shade_texture.h"

namespace radiosity::scene {
namespace {

/// Of a picture that is made smaller: fewer are not worth a thread.
constexpr std::size_t kBytesAThread = std::size_t{1} << 18;

std::string decoderReason() {
  const char* reason = stbi_failure_reason();
  return reason == nullptr ? "unknown reason" : reason;
}

Result<std::pair<std::uint32_t, std::uint32_t>> sizeByStb(const Bytes& bytes, const std::string& where) {
  int width = 0, height = 0, channels = 0;
  if (stbi_info_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height, &channels) == 0 ||
      width <= 0 || height <= 0) {
    return fail(ErrorCode::kBadInput, "image header cannot be read: " + decoderReason(), where);
  }
  return std::pair{static_cast<std::uint32_t>(width), static_cast<std::uint32_t>(height)};
}

std::uint8_t coded(float value, bool srgb) {
  const float of = !srgb                 ? value
                   : value <= 0.0031308F ? 12.92F * value
                                         : 1.055F * std::pow(value, 1.0F / 2.4F) - 0.055F;
  return static_cast<std::uint8_t>(std::lround(255.0F * std::clamp(of, 0.0F, 1.0F)));
}

/// Linear values as bytes. A power for each of millions of pixels would take longer than to decode them.
class ByteCoder {
 public:
  explicit ByteCoder(bool srgb) {
    for (std::size_t byte = 1; byte < least_.size(); ++byte)
      least_[byte] = leastOf(static_cast<std::uint8_t>(byte), srgb);
    for (std::size_t i = 0, byte = 0; i < first_.size(); ++i) {
      while (byte + 1 < least_.size() && least_[byte + 1] <= static_cast<float>(i) / kSteps) ++byte;
      first_[i] = static_cast<std::uint8_t>(byte);
    }
  }

  /// As coded().
  [[nodiscard]] std::uint8_t operator()(float value) const {
    value = std::clamp(value, 0.0F, 1.0F);
    std::size_t byte = first_[static_cast<std::size_t>(value * kSteps)];
    while (byte < 255 && value >= least_[byte + 1]) ++byte;
    return static_cast<std::uint8_t>(byte);
  }

 private:
  static constexpr float kSteps = 4096.0F;

  /// The least value that is coded so. Positive floats are in the order of their bits.
  static float leastOf(std::uint8_t byte, bool srgb) {
    std::uint32_t low = 0, high = std::bit_cast<std::uint32_t>(1.0F);
    while (low < high) {
      const auto middle = low + (high - low) / 2;
      if (coded(std::bit_cast<float>(middle), srgb) >= byte) {
        high = middle;
      } else {
        low = middle + 1;
      }
    }
    return std::bit_cast<float>(low);
  }

  std::array<float, 256> least_{};          ///< by byte
  std::array<std::uint8_t, 4097> first_{};  ///< by value, in steps: the byte of the step's beginning
};

const ByteCoder& coderOf(bool srgb) {
  static const ByteCoder kPlain(false), kSrgb(true);
  return srgb ? kSrgb : kPlain;
}

/// Pixels that are somebody else's.
struct Pixels {
  const std::uint8_t* rgba;
  int width, height;
  bool srgb;
};

/// Of colours, and of alpha.
struct Coders {
  const ByteCoder &colour, &alpha;
};

/// The mean of a block of pixels.
void average(const Pixels& from, const glm::ivec2& low, const glm::ivec2& end, const Coders& coders,
             std::uint8_t* out) {
  glm::vec3 plain(0.0F), covered(0.0F);
  float alpha = 0.0F;
  for (int y = low.y; y < end.y; ++y)
    for (int x = low.x; x < end.x; ++x) {
      const auto index = static_cast<std::size_t>(y) * static_cast<std::size_t>(from.width);
      const auto pixel = linearPixel(from.rgba + 4 * (index + static_cast<std::size_t>(x)), from.srgb);
      plain += glm::vec3(pixel);
      covered += glm::vec3(pixel) * pixel.a;
      alpha += pixel.a;
    }
  const auto count = static_cast<float>((end.x - low.x) * (end.y - low.y));
  const auto rgb = from.srgb && alpha > 0.0F ? covered / alpha : plain / count;
  for (int c = 0; c < 3; ++c) out[c] = coders.colour(rgb[c]);
  out[3] = coders.alpha(alpha / count);
}

Texture halved(const Pixels& from) {
  Texture to;
  to.width = std::max(1, from.width / 2);
  to.height = std::max(1, from.height / 2);
  to.srgb = from.srgb;
  const auto row = std::size_t{4} * static_cast<std::size_t>(to.width);
  to.rgba.resize(row * static_cast<std::size_t>(to.height));
  // Of odd sizes the last pixel takes in one more.
  const auto endOf = [](int i, int size, int all) { return i + 1 == size ? all : 2 * (i + 1); };
  const Coders coders{coderOf(from.srgb), coderOf(false)};
  inTurns(
      static_cast<std::size_t>(to.height),
      [&](std::size_t turn) {
        const auto y = static_cast<int>(turn);
        auto* out = to.rgba.data() + row * turn;
        for (int x = 0; x < to.width; ++x, out += 4)
          average(from, {2 * x, 2 * y}, {endOf(x, to.width, from.width), endOf(y, to.height, from.height)}, coders,
                  out);
      },
      to.rgba.size() / kBytesAThread);
  return to;
}

Pixels pixelsOf(const Texture& texture) { return {texture.rgba.data(), texture.width, texture.height, texture.srgb}; }

/// stb_image inflates 16 bits a channel before it makes eight of them.
bool isDeepPng(const Bytes& bytes) {
  constexpr std::size_t kDepth = 24;  // of the file: 8 bytes of signature, 8 of the chunk's head, width, height
  return sniffImageType(bytes) == "image/png" && bytes.size() > kDepth && bytes[kDepth] == 16;
}

/// Progressive pictures have ten or so. Each is a walk over all blocks, even where it says nothing in a hundred bytes.
constexpr std::ptrdiff_t kMostScans = 256;

/// Of the picture alone: neither those of a thumbnail in a segment of its head, nor what follows its end.
std::ptrdiff_t scansOfJpeg(const Bytes& bytes) {
  if (sniffImageType(bytes) != "image/jpeg") return 0;
  constexpr std::uint8_t kStuffed = 0x00, kFirstRestart = 0xD0, kLastRestart = 0xD7, kEnd = 0xD9, kScan = 0xDA;
  std::ptrdiff_t count = 0;
  for (std::size_t i = 2; i + 3 < bytes.size();) {
    const auto code = bytes[i + 1];
    const bool is_marker = bytes[i] == 0xFF && code != kStuffed && code != 0xFF && code != 0x01 &&
                           !(code >= kFirstRestart && code <= kLastRestart);
    if (!is_marker) {  // data of a scan, or filling
      ++i;
      continue;
    }
    if (code == kEnd) break;
    count += code == kScan ? 1 : 0;
    i += 2 + (std::size_t{bytes[i + 2]} << 8U | bytes[i + 3]);
  }
  return count;
}

/// Of the chunk that begins at `at`; nothing: it is not whole.
struct PngChunk {
  std::string_view type;
  std::span<const std::uint8_t> data;
};
std::optional<PngChunk> pngChunkAt(const Bytes& bytes, std::size_t at) {
  constexpr std::size_t kHead = 8;
  if (bytes.size() < at + kHead) return std::nullopt;
  const auto length = std::size_t{bytes[at]} << 24U | std::size_t{bytes[at + 1]} << 16U |
                      std::size_t{bytes[at + 2]} << 8U | bytes[at + 3];
  if (length > bytes.size() - at - kHead) return std::nullopt;
  return PngChunk{{reinterpret_cast<const char*>(&bytes[at + 4]), 4}, std::span(bytes).subspan(at + kHead, length)};
}

/// Whether a PNG inflates to more than `most` bytes. stb_image would inflate two gigabytes of a picture of one pixel
/// before it looks how many it needs. What is broken inflates to what can be had of it. O(bytes there and inflated).
bool inflatesBeyond(const Bytes& bytes, std::uint64_t most) {
  constexpr std::size_t kSignature = 8, kBesideData = 12, kScratch = std::size_t{1} << 16U;
  z_stream stream{};
  if (inflateInit(&stream) != Z_OK) return false;
  std::vector<std::uint8_t> scratch(kScratch);
  bool beyond = false;
  int status = Z_OK;
  for (std::size_t at = kSignature; status == Z_OK && !beyond;) {
    const auto chunk = pngChunkAt(bytes, at);
    if (!chunk || chunk->type == "IEND") break;
    at += kBesideData + chunk->data.size();
    if (chunk->type != "IDAT") continue;
    stream.next_in = const_cast<Bytef*>(chunk->data.data());  // zlib only reads it
    stream.avail_in = static_cast<uInt>(chunk->data.size());
    while (status == Z_OK && !beyond && (stream.avail_in > 0 || stream.avail_out == 0)) {
      interruptionPoint();
      stream.next_out = scratch.data();
      stream.avail_out = static_cast<uInt>(scratch.size());
      status = inflate(&stream, Z_NO_FLUSH);
      beyond = stream.total_out > most;
    }
    if (status == Z_BUF_ERROR) status = Z_OK;  // more is to come
  }
  (void)inflateEnd(&stream);
  return beyond;
}

/// What the pixels of a PNG take before they are filtered back, twice: interlaced ones have more rows, and some files
/// have a little more than they need.
std::uint64_t mostInflated(const ImageSize& size, bool deep) {
  constexpr std::uint64_t kSpare = std::uint64_t{1} << 16U, kChannels = 4;
  return 2 * size.height * (kChannels * (deep ? 2 : 1) * size.width + 1) + kSpare;
}

bool isKtx2(const Bytes& bytes) {
  constexpr std::array<std::uint8_t, 7> kMagic = {0xAB, 'K', 'T', 'X', ' ', '2', '0'};
  return bytes.size() >= kMagic.size() && std::equal(kMagic.begin(), kMagic.end(), bytes.begin());
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
  if (isWebp(bytes)) return "image/webp";
  return "";
}

Result<ImageSize> sizeOfImage(const Bytes& bytes, std::size_t max_pixels, const std::string& where) {
  // stb_image knows more formats, but glTF does not, and they are the less tested ones.
  if (sniffImageType(bytes).empty()) {
    const char* what = isKtx2(bytes)
                           ? "is KTX2, which the server does not decode; 'radiosity' and the viewer turn it into "
                             "PNG where KHR_texture_basisu names it"
                           : "is neither PNG nor JPEG nor WebP";
    return fail(ErrorCode::kUnsupported, what, where);
  }
  if (bytes.size() > static_cast<std::size_t>(std::numeric_limits<int>::max())) {
    return fail(ErrorCode::kTooLarge, "image file has more than 2 GiB", where);
  }
  const auto read = isWebp(bytes) ? sizeOfWebp(bytes, where) : sizeByStb(bytes, where);
  if (!read) return tl::unexpected(read.error());
  const ImageSize size{read->first, read->second};
  if (const auto scans = scansOfJpeg(bytes); scans > kMostScans) {
    return fail(ErrorCode::kTooLarge,
                "image has " + std::to_string(scans) + " scans; the limit is " + std::to_string(kMostScans), where);
  }
  if (isDeepPng(bytes)) max_pixels /= 2;
  if (size.pixels() > max_pixels) {
    return fail(ErrorCode::kTooLarge,
                "image is " + std::to_string(size.width) + " x " + std::to_string(size.height) + "; the limit is " +
                    std::to_string(max_pixels) + (isDeepPng(bytes) ? " pixels of 16 bits a channel" : " pixels"),
                where);
  }
  return size;
}

Result<Texture> decodeImage(const Bytes& bytes, std::size_t max_pixels, const std::string& where, const ImageUse& use) {
  const auto size = sizeOfImage(bytes, max_pixels, where);
  if (!size) return tl::unexpected(size.error());
  if (sniffImageType(bytes) == "image/png" && inflatesBeyond(bytes, mostInflated(*size, isDeepPng(bytes))))
    return fail(ErrorCode::kTooLarge, "image has more data than pixels", where);
  int width = 0, height = 0, channels = 0;
  const bool webp = isWebp(bytes);
  auto rgba =
      webp ? decodeWebp(bytes, width, height)
           : std::unique_ptr<stbi_uc, void (*)(void*)>(
                 stbi_load_from_memory(bytes.data(), static_cast<int>(bytes.size()), &width, &height, &channels, 4),
                 stbi_image_free);
  const auto pixels = static_cast<std::size_t>(width) * static_cast<std::size_t>(height);
  // The size is checked again: the header scan and the decoder are two readers of one file.
  if (!rgba || pixels != size->pixels()) {
    return fail(ErrorCode::kBadInput, "image cannot be decoded: " + (webp ? "the WebP is broken" : decoderReason()),
                where);
  }
  if (use.halvings > 0) {  // what is held is never copied at the size of the file
    auto texture = halved({rgba.get(), width, height, use.srgb});
    rgba.reset();
    halve(texture, use.halvings - 1);
    return texture;
  }
  Texture texture;
  texture.width = width;
  texture.height = height;
  texture.srgb = use.srgb;
  texture.rgba.assign(rgba.get(), rgba.get() + pixels * 4);
  return texture;
}

void halve(Texture& texture, std::uint32_t times) {
  for (std::uint32_t i = 0; i < times; ++i) texture = halved(pixelsOf(texture));
}

}  // namespace radiosity::scene
