// In which order a session sends what has changed.
#include "server/net/tile_lane.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>
#include <utility>
#include <vector>

namespace radiosity::testing {
namespace {

using ::testing::ElementsAre;
using ::testing::Pair;

/// A page as high as a tile.
class TileLaneTest : public ::testing::Test {
 protected:
  using Changes = std::vector<std::vector<float>>;
  using Sent = std::vector<std::pair<int, std::uint32_t>>;  ///< mip, and tile from the left

  using Lightmaps = std::shared_ptr<const engine::Lightmaps>;

  /// The next version, in which every tile has changed, by so much.
  Lightmaps made(Changes changes, std::uint64_t layout = 1) {
    auto page = std::make_shared<engine::PageSnapshot>();
    ++version_;
    for (std::size_t mip = 0; mip < changes.size(); ++mip) {
      page->mips.emplace_back(static_cast<int>(changes[mip].size()) * 64, 64 >> mip);
      page->tile_version.emplace_back(changes[mip].size(), version_);
    }
    page->tile_change = std::move(changes);
    auto lightmaps = std::make_shared<engine::Lightmaps>();
    lightmaps->layout = layout;
    lightmaps->tile_version = version_;
    lightmaps->pages = {std::move(page)};
    return lightmaps;
  }
  Lightmaps publish(Changes changes) {
    auto lightmaps = made(std::move(changes));
    (void)lane_.setLightmaps(lightmaps);
    return lightmaps;
  }
  /// All that the credit lets through.
  Sent take(std::int64_t credit = protocol::kMaxCreditBytes) {
    lane_.setCredit(credit);
    Sent sent;
    while (const auto frame = lane_.next(cache_)) {
      Bytes bytes(frame->header.begin(), frame->header.end());
      bytes.insert(bytes.end(), frame->pixels->payload.begin(), frame->pixels->payload.end());
      const auto tile = protocol::decodeTile(bytes);
      if (!tile) break;
      sent.emplace_back(tile->header.mip, tile->header.x / protocol::kTileSide);
    }
    return sent;
  }

  net::TileLane lane_;
  net::TileCache cache_;
  std::uint64_t version_ = 0;
};

TEST_F(TileLaneTest, WhatIsThereAlreadyComesByChangeTimesArea) {
  lane_.subscribe({});
  publish({{1, 1, 1, 1}, {1, 1}});
  EXPECT_EQ(take().size(), 6U);
  publish({{0.1F, 0.4F, 0.2F, 0.3F}, {0.06F, 0.15F}});  // a texel of mip 1 covers four
  EXPECT_THAT(take(), ElementsAre(Pair(1, 1U), Pair(0, 1U), Pair(0, 3U), Pair(1, 0U), Pair(0, 2U), Pair(0, 0U)));
}

TEST_F(TileLaneTest, WhatChangesLittleIsNotPassedOverForEver) {
  lane_.subscribe({});
  publish({{1, 1}});
  EXPECT_EQ(take().size(), 2U);
  std::vector<std::uint32_t> order;
  for (int i = 0; i < 4; ++i) {
    publish({{1.0F, 0.3F}});
    for (const auto& [mip, tile] : take(1)) order.push_back(tile);
  }
  EXPECT_THAT(order, ElementsAre(0U, 0U, 0U, 1U)) << "four versions behind it is worth more";
}

TEST_F(TileLaneTest, LightmapsThatAreAllSentAreNotKept) {
  lane_.subscribe({});
  publish({{1, 1}});
  EXPECT_EQ(take().size(), 2U);
  EXPECT_TRUE(lane_.holdsLightmaps());
  ASSERT_TRUE(lane_.takeBookmark().has_value());
  EXPECT_FALSE(lane_.holdsLightmaps());
  publish({{1, 1}});
  EXPECT_EQ(take().size(), 2U) << "what was sent is known without them";
  EXPECT_EQ(lane_.takeBookmark()->tile_version, version_);
}

TEST_F(TileLaneTest, WhatIsStillToBeSentIsSentFromNewerOnesWithoutTakingThem) {
  lane_.subscribe({});
  const auto first = publish({{1, 1, 1}});
  EXPECT_EQ(take(1).size(), 1U);
  const auto second = made({{1, 1, 1}});
  EXPECT_TRUE(lane_.sendFrom(second));
  EXPECT_EQ(take().size(), 2U) << "the one that was sent waits for its time";
  const auto bookmark = lane_.takeBookmark();
  ASSERT_TRUE(bookmark.has_value());
  EXPECT_EQ(bookmark->tile_version, first->tile_version) << "not everything is newer than that";
  (void)lane_.setLightmaps(second);
  EXPECT_EQ(take().size(), 1U);
  EXPECT_EQ(lane_.takeBookmark()->tile_version, second->tile_version);
}

TEST_F(TileLaneTest, WhatIsLaidOutOtherwiseIsTakenAtOnceOnlyWhereSomethingIsStillToBeSent) {
  lane_.subscribe({});
  publish({{1, 1}});
  const auto other = made({{1, 1, 1}}, 2);
  EXPECT_EQ(take(1).size(), 1U);
  EXPECT_FALSE(lane_.sendFrom(other));
  EXPECT_EQ(take().size(), 1U);
  (void)lane_.takeBookmark();
  EXPECT_TRUE(lane_.sendFrom(other));
  EXPECT_FALSE(lane_.holdsLightmaps());
}

}  // namespace
}  // namespace radiosity::testing
