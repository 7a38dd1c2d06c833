// Lightmaps of every quantity: what they hold, and that only what is watched is made.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::Quantity;
using test_scenes::lumpedCube;

class Quantities : public EngineTest {
 protected:
  /// The first lightmaps of a quantity that come while it is watched.
  std::shared_ptr<const engine::Lightmaps> shown(Quantity quantity) {
    const auto watching = engine().watch(quantity);
    EXPECT_TRUE(eventually([&] { return told(quantity) != nullptr; }));
    return told(quantity);
  }
  std::shared_ptr<const engine::Lightmaps> told(Quantity quantity) const {
    for (const auto& lightmaps : recorder_->lightmaps())
      if (lightmaps->quantity == quantity) return lightmaps;
    return nullptr;
  }
  /// First channel of a quantity at every leaf patch.
  static std::vector<float> values(const engine::Lightmaps& lightmaps, const engine::Lightmaps& ids) {
    std::vector<float> all;
    for (std::size_t p = 0; p < ids.pages.size(); ++p) {
      const auto& known = ids.pages[p]->id_mips[0].ids;
      for (std::size_t i = 0; i < known.size(); ++i)
        if (known[i] != engine::kNoId) all.push_back(lightmaps.pages[p]->mips[0].pixels[i].x);
    }
    return all;
  }
};

TEST_F(Quantities, OnlyWhatIsWatchedIsPublished) {
  solve(lumpedCube(0.5));
  for (const auto& lightmaps : recorder_->lightmaps()) EXPECT_EQ(lightmaps->quantity, Quantity::kIrradiance);
  auto watching = engine().watch(Quantity::kError);
  ASSERT_TRUE(eventually([&] { return told(Quantity::kError) != nullptr; }));
  EXPECT_EQ(told(Quantity::kError)->tile_version, engine().lightmaps()->tile_version)
      << "looking at the same light makes no new version";
  watching.reset();
  recorder_->forget();
  ASSERT_TRUE(restart());
  ASSERT_TRUE(reaches(State::kConverged));
  (void)sceneText();
  EXPECT_NE(told(Quantity::kIrradiance), nullptr);
  EXPECT_EQ(told(Quantity::kError), nullptr);
  EXPECT_EQ(engine().lightmaps(Quantity::kError), nullptr);
}

/// Who holds tiles of a version may come back to it, and encoded tiles are kept by it.
TEST_F(Quantities, OneVersionIsOfOneMomentHoweverOftenItIsLookedAt) {
  for (const auto method : {Method::kGather, Method::kShooting, Method::kPaper}) {
    ASSERT_TRUE(configure([&](auto& settings) {
      settings.method = method;
      settings.texels = 60'000;
      settings.target_error = kNever;
    }));
    ASSERT_TRUE(load(lumpedCube(0.5)));
    std::map<std::uint64_t, std::shared_ptr<const engine::Lightmaps>> seen;
    for (int i = 0; i < 60; ++i) {
      recorder_->forget();
      const auto unshot = shown(Quantity::kUnshot);
      ASSERT_NE(unshot, nullptr);
      const auto& before = *seen.try_emplace(unshot->tile_version, unshot).first->second;
      ASSERT_TRUE(before.pages[0]->mips[0].pixels == unshot->pages[0]->mips[0].pixels)
          << "version " << unshot->tile_version << " of " << nameOf(method);
      (void)shown(Quantity::kNormal);  // somebody comes for something else: what nobody looks at is forgotten
    }
  }
}

TEST_F(Quantities, EveryOneThatIsWatchedComesWithEachVersion) {
  const auto error = engine().watch(Quantity::kError);
  const auto level = engine().watch(Quantity::kMipLevel);
  solve(lumpedCube(0.5));
  const auto version = status().tile_version;
  EXPECT_EQ(engine().lightmaps(Quantity::kError)->tile_version, version);
  EXPECT_EQ(engine().lightmaps(Quantity::kMipLevel)->tile_version, version);
  EXPECT_EQ(engine().lightmaps()->tile_version, version);
}

TEST_F(Quantities, ASecondWatcherIsToldWhatThereIs) {
  solve(lumpedCube(0.5));
  const auto first = shown(Quantity::kNormal);
  recorder_->forget();
  EXPECT_EQ(shown(Quantity::kNormal), first);
}

TEST_F(Quantities, RadiosityIsEmissionAndWhatIsReflected) {
  solve(lumpedCube(0.5));
  const auto ids = shown(Quantity::kPatchId);
  const auto irradiance = values(*engine().lightmaps(), *ids);
  const auto radiosity = values(*shown(Quantity::kRadiosity), *ids);
  ASSERT_EQ(irradiance.size(), kCubeTexels);
  int lamps = 0;
  for (std::size_t i = 0; i < irradiance.size(); ++i) {
    const float emitted = radiosity[i] - 0.5F * irradiance[i];  // 1 lux from one face
    EXPECT_TRUE(std::abs(emitted) < 1e-3F || std::abs(emitted - 1.0F) < 1e-3F) << emitted;
    lamps += emitted > 0.5F ? 1 : 0;
  }
  EXPECT_EQ(lamps, 25);
}

TEST_F(Quantities, PatchIdsAreAllDifferentAndNormalsPointAlongTheAxes) {
  solve(lumpedCube(0.5));
  const auto ids = shown(Quantity::kPatchId);
  std::set<std::uint32_t> seen;
  for (const auto id : ids->pages[0]->id_mips[0].ids) {
    if (id == engine::kNoId) continue;
    EXPECT_TRUE(seen.insert(id).second);
  }
  EXPECT_EQ(seen.size(), kCubeTexels);
  EXPECT_TRUE(std::ranges::all_of(seen, [&](auto id) { return id < status().nodes; }));
  for (const auto x : values(*shown(Quantity::kNormal), *ids))
    EXPECT_TRUE(std::abs(x - 0.5F) < 1e-6F || x < 1e-6F || x > 1.0F - 1e-6F) << x;
}

TEST_F(Quantities, WhatIsUnshotIsWhatTheEnergyBalanceSays) {
  // The paper's algorithm, which stops with a tenth of the light unshot; the other one lets shooters stand for all.
  ASSERT_TRUE(configure([](auto& settings) { settings.method = Method::kPaper; }));
  solve(lumpedCube(0.5));
  const auto ids = shown(Quantity::kPatchId);
  double sum = 0.0;
  for (const auto lux : values(*shown(Quantity::kUnshot), *ids)) sum += static_cast<double>(lux) / 25.0;
  EXPECT_GT(std::abs(sum), 1e-3) << "so coarse a solve leaves some";
  EXPECT_NEAR(sum / status().energy.unshot, 1.0, 1e-3) << "all of it is grey";
}

TEST_F(Quantities, LevelsAreThoseOfTheShooters) {
  solve(lumpedCube(0.5));
  const auto levels = shown(Quantity::kMipLevel);
  std::size_t shot = 0;
  for (const auto level : levels->pages[0]->id_mips[0].ids) {
    if (level == engine::kNoId) continue;
    EXPECT_LT(level, 4U);  // 5, 3, 2, 1 texels a side
    ++shot;
  }
  EXPECT_GE(shot, 5 * 25U) << "every face but perhaps the lamp's";
}

TEST_F(Quantities, EveryOneCanBeFetchedAsAnExr) {
  solve(lumpedCube(0.5));
  for (std::size_t q = 0; q < engine::kQuantityCount; ++q) {
    const auto exr =
        call<SharedBytes>([&](auto done) { engine().lightmapExr(0, static_cast<Quantity>(q), {}, std::move(done)); });
    ASSERT_TRUE(exr) << exr.error().text();
    const std::string text((*exr)->begin(), (*exr)->end());
    EXPECT_THAT(text, testing::HasSubstr("unit"));
    EXPECT_EQ(text.substr(0, 4), std::string("\x76\x2f\x31\x01"));
  }
  EXPECT_EQ(call<SharedBytes>([&](auto done) { engine().lightmapExr(9, Quantity::kError, {}, std::move(done)); })
                .error()
                .code,
            ErrorCode::kNotFound);
}

}  // namespace
}  // namespace radiosity::test
