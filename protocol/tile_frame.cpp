#include "protocol/tile_frame.h"

#include <fmt/format.h>
#include <zlib.h>
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>

#include "protocol/pixels.h"

namespace radiosity::protocol {
namespace {

constexpr int kMaxExponent = 128;  ///< beyond what a float can need

template <typename T>
void put(std::span<std::uint8_t> out, std::size_t offset, T value) {
  for (std::size_t i = 0; i < sizeof(T); ++i)
    out[offset + i] = static_cast<std::uint8_t>(static_cast<std::uint64_t>(value) >> (8 * i));
}

template <typename T>
T take(std::span<const std::uint8_t> in, std::size_t offset) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < sizeof(T); ++i) value |= std::uint64_t{in[offset + i]} << (8 * i);
  return static_cast<T>(value);
}

/// The power of two by which values are divided before they are stored; see encodePixels.
int scaleExponent(float largest) {
  if (largest == 0.0F || (largest >= 0x1p-8F && largest < 0x1p15F)) return 0;
  int exponent = 0;
  std::frexp(largest, &exponent);  // largest < 2^exponent
  return exponent - 15;
}

void putPixel(Bytes& raw, std::size_t offset, PixelFormat format, glm::vec3 v) {
  if (format == PixelFormat::kRgb9e5) return put(std::span(raw), offset, rgb9e5FromFloat(v));
  const bool half = format == PixelFormat::kRgba16f;
  for (int c = 0; c < 4; ++c) {
    const float value = c < 3 ? v[c] : 1.0F;
    const auto channel = static_cast<std::size_t>(c);
    if (half)
      put(std::span(raw), offset + 2 * channel, halfFromFloat(value));
    else
      put(std::span(raw), offset + 4 * channel, std::bit_cast<std::uint32_t>(value));
  }
}

/// zlib format at the fastest level; nothing when that does not make it smaller.
std::optional<Bytes> deflated(const Bytes& raw) {
  Bytes out(raw.size());
  auto length = static_cast<uLongf>(out.size());
  const int rc = compress2(out.data(), &length, raw.data(), static_cast<uLong>(raw.size()), Z_BEST_SPEED);
  if (rc != Z_OK || length >= raw.size()) return std::nullopt;
  out.resize(length);
  out.shrink_to_fit();
  return out;
}

EncodedPixels finish(Bytes raw, PixelFormat format, Codec codec, int width, int height, int exponent) {
  EncodedPixels out;
  out.format = format;
  out.width = static_cast<std::uint16_t>(width);
  out.height = static_cast<std::uint16_t>(height);
  out.exponent = exponent;
  out.crc32c = crc32c(raw);
  std::optional<Bytes> smaller;
  if (codec == Codec::kDeflate) smaller = deflated(raw);
  out.codec = smaller ? Codec::kDeflate : Codec::kNone;
  out.payload = smaller ? std::move(*smaller) : std::move(raw);
  return out;
}

tl::unexpected<Error> bad(std::size_t offset, const std::string& what) {
  return fail(ErrorCode::kBadInput, what, fmt::format("tile frame, byte {}", offset));
}

/// Fields that must lie in a set; everything the pixels' size is computed from.
Result<void> checkHeader(std::span<const std::uint8_t> frame) {
  if (frame.size() < kTileHeaderBytes)
    return bad(0, fmt::format("{} bytes; the header alone has {}", frame.size(), kTileHeaderBytes));
  if (take<std::uint32_t>(frame, 0) != kTileMagic) return bad(0, "magic is not RADT");
  if (frame[4] != kTileVersion) return bad(4, fmt::format("version {} is not known", frame[4]));
  if (frame[5] > static_cast<std::uint8_t>(Quantity::kNormal)) return bad(5, fmt::format("kind {}", frame[5]));
  if (frame[6] > static_cast<std::uint8_t>(PixelFormat::kR32ui))
    return bad(6, fmt::format("pixel format {}", frame[6]));
  if (frame[7] > static_cast<std::uint8_t>(Codec::kDeflate)) return bad(7, fmt::format("codec {}", frame[7]));
  if (take<std::uint16_t>(frame, 12) > kMaxMip) return bad(12, "mip is out of range");
  for (const std::size_t offset : {24U, 26U}) {
    const auto side = take<std::uint16_t>(frame, offset);
    if (side == 0 || side > kTileSide) return bad(offset, fmt::format("side of {} texels, not 1..64", side));
  }
  const auto exponent = take<std::int32_t>(frame, 28);
  const auto format = static_cast<PixelFormat>(frame[6]);
  const bool scaled = format == PixelFormat::kRgba16f || format == PixelFormat::kRgb9e5;
  if (exponent < -2 * kMaxExponent || exponent > kMaxExponent || (!scaled && exponent != 0))
    return bad(28, fmt::format("scale exponent {}", exponent));
  const auto error = std::bit_cast<float>(take<std::uint32_t>(frame, 52));
  if (!(error >= 0.0F) || std::isinf(error)) return bad(52, "error is negative or not finite");
  return {};
}

TileHeader readHeader(std::span<const std::uint8_t> frame) {
  TileHeader h;
  h.kind = static_cast<Quantity>(frame[5]);
  h.format = static_cast<PixelFormat>(frame[6]);
  h.codec = static_cast<Codec>(frame[7]);
  h.page = take<std::uint32_t>(frame, 8);
  h.mip = take<std::uint16_t>(frame, 12);
  h.flags = take<std::uint16_t>(frame, 14);
  h.x = take<std::uint32_t>(frame, 16);
  h.y = take<std::uint32_t>(frame, 20);
  h.width = take<std::uint16_t>(frame, 24);
  h.height = take<std::uint16_t>(frame, 26);
  h.exponent = take<std::int32_t>(frame, 28);
  h.revision = take<std::uint64_t>(frame, 32);
  h.tile_version = take<std::uint64_t>(frame, 40);
  h.shots = take<std::uint32_t>(frame, 48);
  h.error = std::bit_cast<float>(take<std::uint32_t>(frame, 52));
  h.payload_bytes = take<std::uint32_t>(frame, 56);
  h.crc32c = take<std::uint32_t>(frame, 60);
  return h;
}

/// Just `size` bytes, or nothing: a stream that is longer, shorter, damaged or followed by more is refused.
std::optional<Bytes> inflated(std::span<const std::uint8_t> payload, std::size_t size) {
  Bytes raw(size);
  auto length = static_cast<uLongf>(size);
  auto consumed = static_cast<uLong>(payload.size());
  if (uncompress2(raw.data(), &length, payload.data(), &consumed) != Z_OK) return std::nullopt;
  if (length != size || consumed != payload.size()) return std::nullopt;
  return raw;
}

}  // namespace

std::size_t pixelBytes(PixelFormat format) {
  switch (format) {
    case PixelFormat::kRgba16f:
      return 8;
    case PixelFormat::kRgba32f:
      return 16;
    case PixelFormat::kRgb9e5:
    case PixelFormat::kR32ui:
      return 4;
  }
  return 0;
}

Result<EncodedPixels> encodePixels(const Image& image, Region r, PixelFormat format, Codec codec) {
  const int side = static_cast<int>(kTileSide);
  if (r.x < 0 || r.y < 0 || r.width < 1 || r.height < 1 || r.width > side || r.height > side ||
      r.x > image.width - r.width || r.y > image.height - r.height || format == PixelFormat::kR32ui)
    return fail(ErrorCode::kInternal, "tile region outside the image, or a format without floats");
  float largest = 0.0F;
  for (int y = r.y; y < r.y + r.height; ++y)
    for (int x = r.x; x < r.x + r.width; ++x)
      for (int c = 0; c < 3; ++c) {
        const float v = image.at(x, y)[c];
        if (!std::isfinite(v))
          return fail(ErrorCode::kInternal, fmt::format("texel ({}, {}) is not finite; it cannot be sent", x, y));
        largest = std::max(largest, std::abs(v));
      }
  const int exponent = format == PixelFormat::kRgba32f ? 0 : scaleExponent(largest);
  const auto bytes = pixelBytes(format);
  Bytes raw(static_cast<std::size_t>(r.width) * static_cast<std::size_t>(r.height) * bytes);
  std::size_t offset = 0;
  for (int y = r.y; y < r.y + r.height; ++y)
    for (int x = r.x; x < r.x + r.width; ++x, offset += bytes) {
      const auto& v = image.at(x, y);
      putPixel(raw, offset, format,
               {std::ldexp(v.x, -exponent), std::ldexp(v.y, -exponent), std::ldexp(v.z, -exponent)});
    }
  return finish(std::move(raw), format, codec, r.width, r.height, exponent);
}

Result<EncodedPixels> encodeIds(std::span<const std::uint32_t> ids, int width, int height, Codec codec) {
  const int side = static_cast<int>(kTileSide);
  if (width < 1 || height < 1 || width > side || height > side ||
      ids.size() != static_cast<std::size_t>(width) * static_cast<std::size_t>(height))
    return fail(ErrorCode::kInternal, "IDs do not fill the tile");
  Bytes raw(ids.size() * 4);
  for (std::size_t i = 0; i < ids.size(); ++i) put(std::span(raw), 4 * i, ids[i]);
  return finish(std::move(raw), PixelFormat::kR32ui, codec, width, height, 0);
}

std::array<std::uint8_t, kTileHeaderBytes> encodeTileHeader(const TileHeader& header, const EncodedPixels& pixels) {
  std::array<std::uint8_t, kTileHeaderBytes> bytes{};
  const std::span<std::uint8_t> out(bytes);
  put(out, 0, kTileMagic);
  out[4] = kTileVersion;
  out[5] = static_cast<std::uint8_t>(header.kind);
  out[6] = static_cast<std::uint8_t>(pixels.format);
  out[7] = static_cast<std::uint8_t>(pixels.codec);
  put(out, 8, header.page);
  put(out, 12, header.mip);
  put(out, 14, header.flags);
  put(out, 16, header.x);
  put(out, 20, header.y);
  put(out, 24, pixels.width);
  put(out, 26, pixels.height);
  put(out, 28, static_cast<std::uint32_t>(pixels.exponent));
  put(out, 32, header.revision);
  put(out, 40, header.tile_version);
  put(out, 48, header.shots);
  put(out, 52, std::bit_cast<std::uint32_t>(header.error));
  put(out, 56, static_cast<std::uint32_t>(pixels.payload.size()));
  put(out, 60, pixels.crc32c);
  return bytes;
}

Bytes encodeTile(const TileHeader& header, const EncodedPixels& pixels) {
  const auto head = encodeTileHeader(header, pixels);
  Bytes frame(head.size() + pixels.payload.size());
  std::copy(pixels.payload.begin(), pixels.payload.end(), std::copy(head.begin(), head.end(), frame.begin()));
  return frame;
}

Result<Tile> decodeTile(std::span<const std::uint8_t> frame) {
  if (auto checked = checkHeader(frame); !checked) return tl::unexpected(std::move(checked.error()));
  Tile tile{readHeader(frame), {}};
  const auto& h = tile.header;
  const auto payload = frame.subspan(kTileHeaderBytes);
  const std::size_t expected = std::size_t{h.width} * h.height * pixelBytes(h.format);
  if (h.payload_bytes != payload.size())
    return bad(56, fmt::format("payload of {} bytes announced, {} there", h.payload_bytes, payload.size()));
  if (payload.size() > expected || (h.codec == Codec::kNone && payload.size() != expected))
    return bad(56, fmt::format("payload of {} bytes for {} bytes of pixels", payload.size(), expected));
  if (h.codec == Codec::kNone) {
    tile.raw.assign(payload.begin(), payload.end());
  } else {
    auto raw = inflated(payload, expected);
    if (!raw) return bad(kTileHeaderBytes, fmt::format("payload does not inflate to {} bytes", expected));
    tile.raw = std::move(*raw);
  }
  if (crc32c(tile.raw) != h.crc32c) return bad(60, "CRC-32C of the pixels does not match");
  return tile;
}

Result<Image> tileImage(const Tile& tile) {
  const auto& h = tile.header;
  const auto bytes = pixelBytes(h.format);
  if (h.format == PixelFormat::kR32ui) return bad(6, "r32ui holds IDs, not values");
  if (tile.raw.size() != std::size_t{h.width} * h.height * bytes) return bad(56, "pixels do not fill the tile");
  Image image(h.width, h.height);
  const std::span<const std::uint8_t> raw(tile.raw);
  for (std::size_t i = 0; i < image.pixels.size(); ++i) {
    auto& v = image.pixels[i];
    if (h.format == PixelFormat::kRgb9e5) v = floatFromRgb9e5(take<std::uint32_t>(raw, i * bytes));
    for (int c = 0; c < 3; ++c) {
      const auto channel = static_cast<std::size_t>(c);
      if (h.format == PixelFormat::kRgba16f) v[c] = floatFromHalf(take<std::uint16_t>(raw, i * bytes + 2 * channel));
      if (h.format == PixelFormat::kRgba32f)
        v[c] = std::bit_cast<float>(take<std::uint32_t>(raw, i * bytes + 4 * channel));
      v[c] = std::ldexp(v[c], h.exponent);
      if (!std::isfinite(v[c])) return bad(kTileHeaderBytes + i * bytes, "value is not finite");
    }
  }
  return image;
}

Result<std::vector<std::uint32_t>> tileIds(const Tile& tile) {
  if (tile.header.format != PixelFormat::kR32ui || tile.raw.size() % 4 != 0) return bad(6, "not an r32ui tile");
  std::vector<std::uint32_t> ids(tile.raw.size() / 4);
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = take<std::uint32_t>(std::span(tile.raw), 4 * i);
  return ids;
}

}  // namespace radiosity::protocol
