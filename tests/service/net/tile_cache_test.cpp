// The bound of the cache of encoded tiles.
#include "server/net/tile_cache.h"

#include <gtest/gtest.h>

namespace radiosity::testing {
namespace {

engine::PageSnapshot pageOf(int side) {
  engine::PageSnapshot page;
  page.mips.emplace_back(side, side);
  return page;
}

TEST(TileCache, StaysBelowItsBoundHoweverSmallTheTiles) {
  constexpr std::size_t kBound = 65536;
  for (const int side : {1, 64}) {
    net::TileCache cache(kBound);
    const auto page = pageOf(side);
    net::TileCache::Key key;
    key.codec = protocol::Codec::kDeflate;  // black: a few bytes
    for (key.version = 1; key.version <= 5000; ++key.version) {
      ASSERT_TRUE(cache.get(key, page));
      ASSERT_LE(cache.bytes(), kBound);
    }
    key.version = 5000;
    ASSERT_TRUE(cache.get(key, page));
    EXPECT_EQ(cache.encoded(), 5000U) << "the newest is still there";
    key.version = 1;
    ASSERT_TRUE(cache.get(key, page));
    // What keeps a tile, a place in a map and one in a queue, takes more than such a tile.
    EXPECT_EQ(cache.encoded(), 5001U) << "the oldest is still there";
  }
}

}  // namespace
}  // namespace radiosity::testing
