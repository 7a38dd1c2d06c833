#include "server/engine/publisher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace radiosity::engine {
namespace {

scene::LightmapPage uniformPage(int width, int height, float lux) {
  scene::LightmapPage page;
  page.irradiance = Image(width, height, glm::vec3(lux));
  page.coverage.assign(page.irradiance.pixels.size(), 1.0F);
  return page;
}

TEST(Publisher, MipsEndAtOneTexelAndEveryTileIsNewAtFirst) {
  Publisher publisher;
  const auto published = publisher.publish({uniformPage(130, 65, 2.0F)}, Status{}, false);
  ASSERT_EQ(published->pages.size(), 1U);
  const auto& page = *published->pages[0];
  EXPECT_EQ(page.mips.back().width, 1);
  EXPECT_EQ(page.mips.back().height, 1);
  ASSERT_EQ(page.tile_version.size(), page.mips.size());
  EXPECT_EQ(page.tile_version[0], std::vector<std::uint64_t>(6, 1));  // 3 x 2 tiles
  EXPECT_EQ(page.tile_change[0], std::vector<float>(6, 1.0F));
}

TEST(Publisher, UnchangedTilesKeepTheirVersion) {
  Publisher publisher;
  auto page = uniformPage(128, 64, 2.0F);
  (void)publisher.publish({page}, Status{}, false);
  page.irradiance.at(100, 10) = glm::vec3(4.0F);  // in the right one of two tiles
  const auto published = publisher.publish({page}, Status{}, false);
  EXPECT_EQ(published->tile_version, 2U);
  EXPECT_EQ(published->pages[0]->tile_version[0], (std::vector<std::uint64_t>{1, 2}));
  EXPECT_NEAR(published->pages[0]->tile_change[0][1], 0.5 / (64 * 64), 1e-6);
  EXPECT_EQ(published->pages[0]->mips[0].at(100, 10).x, 4.0F);
}

TEST(Publisher, SmallChangesDoNotAddUpUnseen) {
  constexpr float kQuantum = 0x1p-11F;
  Publisher publisher;
  float lux = 1.0F;
  std::uint64_t last = 0;
  int kept = 0, renewed = 0;
  for (int i = 0; i < 64; ++i) {
    const auto published = publisher.publish({uniformPage(64, 64, lux)}, Status{}, false);
    const float seen = published->pages[0]->mips[0].at(5, 5).x;
    EXPECT_LE(std::abs(seen - lux), kQuantum * lux) << "after " << i << " small changes";
    const auto version = published->pages[0]->tile_version[0][0];
    (version == last ? kept : renewed) += 1;
    last = version;
    lux *= 1.0F + 0.3F * kQuantum;
  }
  EXPECT_GT(kept, 32);
  EXPECT_GT(renewed, 8);
}

TEST(Publisher, ResetRaisesTheLayoutAndRenewsEveryTile) {
  Publisher publisher;
  const auto before = publisher.publish({uniformPage(64, 64, 1.0F)}, Status{}, false);
  publisher.reset();
  const auto after = publisher.publish({uniformPage(32, 16, 1.0F)}, Status{}, true);
  EXPECT_GT(after->layout, before->layout);
  EXPECT_GT(after->tile_version, before->tile_version);
  for (const auto& mip : after->pages[0]->tile_version)
    for (const auto version : mip) EXPECT_EQ(version, after->tile_version);
  EXPECT_TRUE(after->final);
  EXPECT_EQ(before->pages[0]->mips[0].width, 64);  // what was published does not change
}

}  // namespace
}  // namespace radiosity::engine
