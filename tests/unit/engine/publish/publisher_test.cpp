#include "server/engine/publish/publisher.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace radiosity::engine {
namespace {

QuantityPages irradianceOf(scene::LightmapPage page) { return {Quantity::kIrradiance, {std::move(page)}, {}, false}; }

scene::LightmapPage uniformPage(int width, int height, float lux) {
  scene::LightmapPage page;
  page.irradiance = Image(width, height, glm::vec3(lux));
  page.coverage.assign(page.irradiance.pixels.size(), 1.0F);
  return page;
}

/// As the solve loop does when the light has changed.
std::shared_ptr<const Lightmaps> publishNew(Publisher& publisher, const QuantityPages& pages, bool final = false) {
  publisher.startVersion();
  return publisher.publish(pages, Status{}, final);
}

TEST(Publisher, MipsEndAtOneTexelAndEveryTileIsNewAtFirst) {
  Publisher publisher;
  const auto published = publishNew(publisher, irradianceOf(uniformPage(130, 65, 2.0F)));
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
  (void)publishNew(publisher, irradianceOf(page));
  page.irradiance.at(100, 10) = glm::vec3(4.0F);  // in the right one of two tiles
  const auto published = publishNew(publisher, irradianceOf(page));
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
    const auto published = publishNew(publisher, irradianceOf(uniformPage(64, 64, lux)));
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
  const auto before = publishNew(publisher, irradianceOf(uniformPage(64, 64, 1.0F)));
  publisher.reset();
  const auto after = publishNew(publisher, irradianceOf(uniformPage(32, 16, 1.0F)), true);
  EXPECT_GT(after->layout, before->layout);
  EXPECT_GT(after->tile_version, before->tile_version);
  for (const auto& mip : after->pages[0]->tile_version)
    for (const auto version : mip) EXPECT_EQ(version, after->tile_version);
  EXPECT_TRUE(after->final);
  EXPECT_EQ(before->pages[0]->mips[0].width, 64);  // what was published does not change
}

TEST(Publisher, QuantitiesShareAVersionAndKeepTheirOwnTiles) {
  Publisher publisher;
  (void)publishNew(publisher, irradianceOf(uniformPage(64, 64, 1.0F)));
  const auto error = publisher.publish({Quantity::kError, {uniformPage(64, 64, 4.0F)}, {}, true}, Status{}, false);
  EXPECT_EQ(error->tile_version, 1U);
  EXPECT_EQ(error->quantity, Quantity::kError);
  publisher.startVersion();
  const auto darker = publisher.publish(irradianceOf(uniformPage(64, 64, 0.5F)), Status{}, false);
  const auto same = publisher.publish({Quantity::kError, {uniformPage(64, 64, 4.0F)}, {}, true}, Status{}, false);
  EXPECT_EQ(darker->pages[0]->tile_version[0][0], 2U);
  EXPECT_EQ(same->tile_version, 2U);
  EXPECT_EQ(same->pages[0]->tile_version[0][0], 1U);
  EXPECT_EQ(publisher.latest(Quantity::kError), same);
  publisher.forget(Quantity::kError);
  EXPECT_EQ(publisher.latest(Quantity::kError), nullptr);
  EXPECT_EQ(publisher.latest(Quantity::kIrradiance), darker);
}

TEST(Publisher, ErrorsAreAveragedAsSquares) {
  Publisher publisher;
  auto page = uniformPage(2, 1, 1.0F);
  page.irradiance.at(1, 0) = glm::vec3(49.0F);
  const auto published = publishNew(publisher, {Quantity::kError, {page}, {}, true});
  EXPECT_FLOAT_EQ(published->pages[0]->mips[0].at(1, 0).x, 7.0F);
  EXPECT_FLOAT_EQ(published->pages[0]->mips[1].at(0, 0).x, 5.0F);  // sqrt((1 + 49) / 2)
}

TEST(Publisher, WholeNumbersAreNeverMixed) {
  Publisher publisher;
  IdImage ids{3, 2, {kNoId, 7, kNoId, 8, 9, 5}};
  const auto first = publishNew(publisher, {Quantity::kPatchId, {}, {ids}, false});
  const auto& page = *first->pages[0];
  ASSERT_EQ(page.mipCount(), 3U);
  EXPECT_EQ(page.id_mips[1].ids, (std::vector<std::uint32_t>{7, 5}));
  EXPECT_EQ(page.id_mips[2].ids, std::vector<std::uint32_t>{7});
  const auto same = publishNew(publisher, {Quantity::kPatchId, {}, {ids}, false});
  EXPECT_EQ(same->pages[0]->tile_version[0][0], 1U);
  ids.ids[4] = 10;  // shows in the finest mip alone
  const auto changed = publishNew(publisher, {Quantity::kPatchId, {}, {ids}, false});
  EXPECT_EQ(changed->pages[0]->tile_version[0][0], 3U);
  EXPECT_EQ(changed->pages[0]->tile_version[1][0], 1U);
}

}  // namespace
}  // namespace radiosity::engine
