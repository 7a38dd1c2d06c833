// Encoded tiles, shared by all sessions: a tile of one version is encoded once for each format and codec, whoever asks
// first. Thread-safe; bounded; the oldest go first.
#pragma once

#include <atomic>
#include <cstdint>
#include <deque>
#include <map>
#include <memory>
#include <mutex>
#include <tuple>

#include "common/result.h"
#include "protocol/tile_frame.h"
#include "server/engine/engine.h"

namespace radiosity::net {

class TileCache {
 public:
  explicit TileCache(std::size_t max_bytes = std::size_t{64} << 20) : max_bytes_(max_bytes) {}

  struct Key {
    engine::Quantity quantity = engine::Quantity::kIrradiance;
    std::uint64_t layout = 0, version = 0;
    std::uint32_t page = 0, mip = 0, tile = 0;
    protocol::PixelFormat format = protocol::PixelFormat::kRgba16f;
    protocol::Codec codec = protocol::Codec::kNone;
    auto operator<=>(const Key&) const = default;
  };
  using Pixels = std::shared_ptr<const protocol::EncodedPixels>;

  /// Whole numbers are encoded as r32ui, whatever Key::format, and unshot light, which has a sign, as rgba16f where
  /// that is rgb9e5. kInternal when a value is not finite.
  [[nodiscard]] Result<Pixels> get(const Key& key, const engine::PageSnapshot& page);

  [[nodiscard]] std::uint64_t encoded() const { return encoded_.load(); }
  /// What is kept, and what keeping it takes.
  [[nodiscard]] std::size_t bytes() const { return bytes_.load(); }

 private:
  std::size_t max_bytes_;
  std::mutex mutex_;
  std::map<Key, Pixels> tiles_;
  std::deque<Key> order_;
  std::atomic<std::size_t> bytes_{0};
  std::atomic<std::uint64_t> encoded_{0};
};

}  // namespace radiosity::net
