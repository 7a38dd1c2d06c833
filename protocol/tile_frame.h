// The binary frame that carries one tile of a lightmap: 64-byte little-endian header, then pixels (README.md, "Tile
// frame"). Absolute values, never deltas. Pure functions; any thread. The decoder trusts nothing: it reads no byte
// beyond the frame and allocates at most kMaxTileRawBytes.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "common/bytes.h"
#include "common/image.h"
#include "common/result.h"
#include "protocol/limits.h"
#include "protocol/messages.h"

namespace radiosity::protocol {

inline constexpr std::uint32_t kTileMagic = 0x54444152;  ///< "RADT", read as little-endian
inline constexpr std::uint8_t kTileVersion = 1;

enum TileFlags : std::uint16_t {
  kTileFinal = 1,  ///< the solve had stopped at its target when this was published
  kTileReset = 2,  ///< first tile of its page after `lightmaps`: drop every older tile of the page
};

struct TileHeader {
  Quantity kind = Quantity::kIrradiance;
  PixelFormat format = PixelFormat::kRgba16f;
  Codec codec = Codec::kNone;
  std::uint32_t page = 0;
  std::uint16_t mip = 0, flags = 0;
  std::uint32_t x = 0, y = 0;           ///< texels of this mip; row 0 = v 0
  std::uint16_t width = 0, height = 0;  ///< 1..kTileSide
  std::int32_t exponent = 0;            ///< value = stored x 2^exponent; 0 for rgba32f and r32ui
  std::uint64_t revision = 0, tile_version = 0;
  std::uint32_t shots = 0;
  float error = 1.0F;
  std::uint32_t payload_bytes = 0;
  std::uint32_t crc32c = 0;  ///< of the raw (decompressed) pixels
};

/// Pixels ready to send; shared by every client that asked for the same format and codec.
struct EncodedPixels {
  PixelFormat format = PixelFormat::kRgba16f;
  Codec codec = Codec::kNone;  ///< none also where deflate would not have shrunk them
  std::uint16_t width = 0, height = 0;
  std::int32_t exponent = 0;
  std::uint32_t crc32c = 0;
  Bytes payload;
};

struct Region {
  int x = 0, y = 0, width = 0, height = 0;
};

[[nodiscard]] std::size_t pixelBytes(PixelFormat format);

/// Encodes a region (at most kTileSide x kTileSide, inside the image) of finite values as rgba16f, rgb9e5 or rgba32f.
/// The exponent is 0 while the brightest value lies in [2^-8, 2^15) and otherwise the power of two that brings it into
/// [2^14, 2^15), so nothing overflows. Accuracy: rgba16f 2^-11 relative for stored values >= 2^-14; rgb9e5 1/511 of the
/// pixel's largest channel, negative values become 0. kInternal: not finite, or the region is not as promised.
[[nodiscard]] Result<EncodedPixels> encodePixels(const Image& image, Region region, PixelFormat format, Codec codec);

/// The same for r32ui (patch IDs): width x height values, row-major.
[[nodiscard]] Result<EncodedPixels> encodeIds(std::span<const std::uint32_t> ids, int width, int height, Codec codec);

/// The header on the wire; format, codec, size, exponent, CRC and payload length are taken from `pixels`.
[[nodiscard]] std::array<std::uint8_t, kTileHeaderBytes> encodeTileHeader(const TileHeader& header,
                                                                          const EncodedPixels& pixels);
/// Header and payload in one buffer.
[[nodiscard]] Bytes encodeTile(const TileHeader& header, const EncodedPixels& pixels);

struct Tile {
  TileHeader header;
  Bytes raw;  ///< width x height x pixelBytes(format), as described in README.md
};

/// kBadInput, naming the field and its byte offset, unless every field is sound, the payload has just the promised
/// length and its CRC-32C matches.
[[nodiscard]] Result<Tile> decodeTile(std::span<const std::uint8_t> frame);

/// Values (lux for irradiance) of an rgba16f, rgb9e5 or rgba32f tile, exponent applied. kBadInput when one is not
/// finite, or for r32ui.
[[nodiscard]] Result<Image> tileImage(const Tile& tile);
/// IDs of an r32ui tile.
[[nodiscard]] Result<std::vector<std::uint32_t>> tileIds(const Tile& tile);

/// CRC-32C (Castagnoli; RFC 3720 appendix B.4), as used by iSCSI and ext4.
[[nodiscard]] std::uint32_t crc32c(std::span<const std::uint8_t> bytes);

}  // namespace radiosity::protocol
