// A tile frame from a server that is not to be trusted. What decodes is in its bounds and encodes to the same pixels.
#include "protocol/tile_frame.h"

#include "tests/fuzz/target.h"

namespace radiosity::fuzz {

using namespace protocol;  // NOLINT: the target speaks the protocol

namespace {

TileHeader someHeader() {
  TileHeader header;
  header.page = 1;
  header.mip = 2;
  header.x = 64;
  header.y = 128;
  header.tile_version = 41;
  header.error = 0.03125F;
  return header;
}

}  // namespace

std::vector<Seed> seeds() {
  std::vector<Seed> all;
  Image image(7, 5, glm::vec3(100.0F, 0.5F, 65504.0F));
  image.at(3, 2) = glm::vec3(0.0F);
  for (const auto format : {PixelFormat::kRgba16f, PixelFormat::kRgb9e5, PixelFormat::kRgba32f})
    for (const auto codec : {Codec::kNone, Codec::kDeflate})
      all.push_back(encodeTile(someHeader(), *encodePixels(image, {0, 0, 7, 5}, format, codec)));
  const std::vector<std::uint32_t> ids(64, 7);
  all.push_back(encodeTile(someHeader(), *encodeIds(ids, 8, 8, Codec::kDeflate)));
  return all;
}

}  // namespace radiosity::fuzz

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace radiosity;  // NOLINT
  const auto tile = protocol::decodeTile({data, size});
  if (!tile) return 0;
  const auto& h = tile->header;
  fuzz::require(h.width >= 1 && h.width <= 64 && h.height >= 1 && h.height <= 64, "a tile has 1 to 64 texels a side");
  fuzz::require(tile->raw.size() == std::size_t{h.width} * h.height * protocol::pixelBytes(h.format),
                "the pixels fill the tile");
  if (h.format == protocol::PixelFormat::kR32ui) {
    const auto ids = protocol::tileIds(*tile);
    fuzz::require(ids.has_value(), "whole numbers are whatever they are");
    fuzz::require(protocol::encodeIds(*ids, h.width, h.height, h.codec)->crc32c == h.crc32c, "numbers come back");
    return 0;
  }
  const auto image = protocol::tileImage(*tile);
  if (!image) return 0;  // infinite, or not a number
  fuzz::require(image->width == h.width && image->height == h.height, "an image of the tile's size");
  const auto again = protocol::encodePixels(*image, {0, 0, h.width, h.height}, h.format, h.codec);
  fuzz::require(again.has_value(), "what was decoded can be encoded");
  return 0;
}
