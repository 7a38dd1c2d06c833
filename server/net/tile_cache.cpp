#include "server/net/tile_cache.h"

#include <algorithm>

namespace radiosity::net {
namespace {

protocol::Region regionOf(const Image& image, std::uint32_t tile) {
  const int side = static_cast<int>(protocol::kTileSide);
  const int across = (image.width + side - 1) / side;
  const int x = static_cast<int>(tile) % across * side;
  const int y = static_cast<int>(tile) / across * side;
  return {x, y, std::min(side, image.width - x), std::min(side, image.height - y)};
}

}  // namespace

Result<TileCache::Pixels> TileCache::get(const Key& key, const engine::PageSnapshot& page) {
  {
    const std::lock_guard lock(mutex_);
    if (const auto found = tiles_.find(key); found != tiles_.end()) return found->second;
  }
  // Encoded outside the lock: two sessions may do the same tile at once, which costs less than waiting.
  const auto& image = page.mips[key.mip];
  auto encoded = protocol::encodePixels(image, regionOf(image, key.tile), key.format, key.codec);
  if (!encoded) return tl::unexpected(std::move(encoded.error()));
  ++encoded_;
  auto pixels = std::make_shared<const protocol::EncodedPixels>(std::move(*encoded));
  const std::lock_guard lock(mutex_);
  const auto [place, inserted] = tiles_.emplace(key, pixels);
  if (!inserted) return place->second;
  order_.push_back(key);
  bytes_ += pixels->payload.size();
  while (bytes_ > max_bytes_ && order_.size() > 1) {
    const auto oldest = tiles_.find(order_.front());
    bytes_ -= oldest->second->payload.size();
    tiles_.erase(oldest);
    order_.pop_front();
  }
  return pixels;
}

}  // namespace radiosity::net
