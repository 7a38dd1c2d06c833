// Pictures are held as large as they may be, which is decided before any is decoded.
#include "server/scene/import/image_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <memory>

#include "server/scene/document/image_decode.h"
#include "server/scene/values/shade_texture.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::scene::test {
namespace {

/// As far as its header, and what follows of no meaning.
SharedBytes pngOf(std::uint32_t width, std::uint32_t height, std::size_t bytes) {
  Bytes png{0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A, 0, 0, 0, 13, 'I', 'H', 'D', 'R'};
  for (const auto size : {width, height})
    for (int shift = 24; shift >= 0; shift -= 8) png.push_back(static_cast<std::uint8_t>(size >> shift));
  png.insert(png.end(), {8, 2, 0, 0, 0, 0, 0, 0, 0});
  png.resize(std::max(png.size(), bytes));
  return std::make_shared<const Bytes>(std::move(png));
}

Document documentWith(const std::vector<SharedBytes>& images) {
  Document document;
  document.name = "test.glb";
  document.images = images;
  for (std::size_t i = 0; i < images.size(); ++i) {
    document.gltf["images"].push_back(Json::object());
    document.gltf["textures"].push_back({{"source", i}});
    document.gltf["materials"].push_back({{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", i}}}}}});
  }
  return document;
}

TEST(ImagePlan, FortyLargePicturesAreHalvedUntilTheyFit) {
  const auto document = documentWith(std::vector<SharedBytes>(40, pngOf(4096, 4096, 1 << 20)));
  ImportLimits limits;
  limits.max_scene_bytes = std::uint64_t{2} << 30;
  const auto plan = planImages(document, 0, limits);
  ASSERT_TRUE(plan) << plan.error().text();
  EXPECT_LE(plan->bytes, kMostImageBytes);
  EXPECT_GT(plan->bytes, kMostImageBytes / 2) << "and not more than that";
  EXPECT_EQ(plan->halved, 40U);
}

TEST(ImagePlan, FewPicturesStayAsTheyAre) {
  const auto document = documentWith({pngOf(4096, 4096, 1 << 20), pngOf(512, 256, 10'000)});
  ImportLimits limits;
  limits.max_scene_bytes = std::uint64_t{2} << 30;
  const auto plan = planImages(document, 0, limits);
  ASSERT_TRUE(plan);
  EXPECT_EQ(plan->halved, 0U);
  EXPECT_EQ(plan->bytes, 4U * (4096U * 4096U + 512U * 256U));
}

TEST(ImagePlan, WhatNoMaterialUsesDoesNotCount) {
  auto document = documentWith({pngOf(4096, 4096, 1 << 20)});
  document.gltf["materials"][0] = {{"normalTexture", {{"index", 0}}}};
  const auto plan = planImages(document, 0, {});
  ASSERT_TRUE(plan);
  EXPECT_EQ(plan->bytes, 0U);
}

TEST(ImagePlan, ManyPixelsOfFewBytesAreRefused) {
  const auto document = documentWith(std::vector<SharedBytes>(64, pngOf(8192, 8192, 4'000)));
  const auto plan = planImages(document, 0, {});
  ASSERT_FALSE(plan);
  EXPECT_EQ(plan.error().code, ErrorCode::kTooLarge);
  EXPECT_EQ(plan.error().where, "test.glb: /images/4");
}

TEST(ImagePlan, WithoutRoomForTheDecoderPicturesAreRefused) {
  const auto document = documentWith({pngOf(4096, 4096, 1 << 20)});
  ImportLimits limits;
  limits.max_scene_bytes = std::uint64_t{64} << 20;
  const auto plan = planImages(document, 0, limits);
  ASSERT_FALSE(plan);
  EXPECT_THAT(plan.error().message, testing::HasSubstr("--max-scene-memory"));
}

TEST(ImageDecode, HalvingKeepsTheMeanOfLinearLight) {
  Texture texture;
  texture.width = 3;
  texture.height = 2;
  texture.rgba = {255, 0, 0, 255, 0, 0, 0, 255, 255, 0, 0, 255, 255, 0, 0, 255, 0, 0, 0, 255, 255, 0, 0, 255};
  halve(texture, 1);
  ASSERT_EQ(texture.width, 1);
  ASSERT_EQ(texture.height, 1);
  EXPECT_NEAR(texture.rgba[0], 212, 1) << "two thirds of the light, in sRGB";
  EXPECT_EQ(texture.rgba[3], 255);
}

TEST(ImageDecode, HalvingTakesNoColourFromWhatIsCutOut) {
  Texture texture;
  texture.width = 2;
  texture.height = 2;
  texture.rgba = {200, 0, 0, 255, 0, 255, 0, 0, 200, 0, 0, 255, 0, 255, 0, 0};
  halve(texture, 4);
  ASSERT_EQ(texture.rgba.size(), 4U);
  EXPECT_NEAR(texture.rgba[0], 200, 1);
  EXPECT_EQ(texture.rgba[1], 0);
  EXPECT_EQ(texture.rgba[3], 128);
}

TEST(ImageDecode, HalvedPixelsAreCodedAsTheFormulaOfSrgbSays) {
  for (const bool srgb : {false, true}) {
    Texture texture;
    texture.width = 512;
    texture.height = 256;
    texture.srgb = srgb;
    for (int y = 0; y < 256; ++y)
      for (int x = 0; x < 256; ++x)
        for (const int value : {x, y}) {
          const auto byte = static_cast<std::uint8_t>(value);
          texture.rgba.insert(texture.rgba.end(), {byte, byte, byte, 255});
        }
    const auto whole = texture;
    halve(texture, 1);
    for (std::size_t i = 0; i < texture.rgba.size(); i += 4) {
      const auto x = static_cast<int>(i / 4 % 256), y = static_cast<int>(i / 4 / 256);
      float mean = 0.0F;
      for (const int row : {2 * y, 2 * y + 1})
        for (const int column : {2 * x, 2 * x + 1}) mean += 0.25F * pixelOf(whole, column, row).r;
      const float coded = !srgb                ? mean
                          : mean <= 0.0031308F ? 12.92F * mean
                                               : 1.055F * std::pow(mean, 1.0F / 2.4F) - 0.055F;
      ASSERT_NEAR(texture.rgba[i], 255.0F * coded, 0.5001F) << x << " " << y;
      ASSERT_EQ(texture.rgba[i + 3], 255);
    }
  }
}

}  // namespace
}  // namespace radiosity::scene::test
