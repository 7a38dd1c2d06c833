#include "server/net/tile_cache.h"

#include <algorithm>
#include <utility>
#include <vector>

namespace radiosity::net {
namespace {

/// What an entry takes beside its pixels, in the map and in the queue. Tiles of one colour are a few dozen bytes.
constexpr std::size_t kEntryBytes = 256;

std::size_t costOf(const TileCache::Pixels& pixels) { return pixels->payload.size() + kEntryBytes; }

protocol::Region regionOf(glm::ivec2 size, std::uint32_t tile) {
  const int side = static_cast<int>(protocol::kTileSide);
  const int across = (size.x + side - 1) / side;
  const int x = static_cast<int>(tile) % across * side;
  const int y = static_cast<int>(tile) / across * side;
  return {x, y, std::min(side, size.x - x), std::min(side, size.y - y)};
}

/// rgb9e5 has no sign: of what was passed on in advance nothing would be left.
protocol::PixelFormat formatOf(const TileCache::Key& key) {
  const bool lacks_sign = key.quantity == engine::Quantity::kUnshot && key.format == protocol::PixelFormat::kRgb9e5;
  return lacks_sign ? protocol::PixelFormat::kRgba16f : key.format;
}

Result<protocol::EncodedPixels> encode(const TileCache::Key& key, const engine::PageSnapshot& page) {
  const auto region = regionOf(page.size(key.mip), key.tile);
  if (!engine::holdsIds(key.quantity))
    return protocol::encodePixels(page.mips[key.mip], region, formatOf(key), key.codec);
  const auto& image = page.id_mips[key.mip];
  std::vector<std::uint32_t> ids;
  for (int y = region.y; y < region.y + region.height; ++y) {
    const auto row = image.ids.begin() + std::ptrdiff_t{y} * image.width + region.x;
    ids.insert(ids.end(), row, row + region.width);
  }
  return protocol::encodeIds(ids, region.width, region.height, key.codec);
}

}  // namespace

Result<TileCache::Pixels> TileCache::get(const Key& key, const engine::PageSnapshot& page) {
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = tiles_.find(key); found != tiles_.end()) return found->second;
  }
  // Encoded outside the lock: two sessions may do the same tile at once, which costs less than waiting.
  auto encoded = encode(key, page);
  if (!encoded) return tl::unexpected(std::move(encoded.error()));
  ++encoded_;
  auto pixels = std::make_shared<const protocol::EncodedPixels>(std::move(*encoded));
  const std::lock_guard lock(mutex_);
  const auto [place, inserted] = tiles_.emplace(key, pixels);
  if (!inserted) return place->second;
  order_.push_back(key);
  bytes_ += costOf(pixels);
  while (bytes_ > max_bytes_ && order_.size() > 1) {
    const auto oldest = tiles_.find(order_.front());
    bytes_ -= costOf(oldest->second);
    tiles_.erase(oldest);
    order_.pop_front();
  }
  return pixels;
}

}  // namespace radiosity::net
