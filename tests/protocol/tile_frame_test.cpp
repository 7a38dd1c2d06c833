#include "protocol/tile_frame.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <string_view>

#include "protocol/pixels.h"

namespace radiosity::protocol {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

Image randomImage(std::mt19937& random, int width, int height, float largest_log2, float decades) {
  std::uniform_real_distribution<float> exponent(largest_log2 - decades, largest_log2);
  Image image(width, height);
  for (auto& pixel : image.pixels)
    for (int c = 0; c < 3; ++c) pixel[c] = std::exp2(exponent(random));
  return image;
}

Result<Image> roundTrip(const Image& image, PixelFormat format, Codec codec = Codec::kNone) {
  return encodePixels(image, {0, 0, image.width, image.height}, format, codec)
      .and_then([](const EncodedPixels& pixels) { return decodeTile(encodeTile({}, pixels)).and_then(tileImage); });
}

Bytes someFrame(Codec codec) {
  std::mt19937 random(3);
  auto image = randomImage(random, 16, 8, 4.0F, 8.0F);
  for (int x = 0; x < 16; ++x) image.at(x, 3) = glm::vec3(1.0F);
  return encodeTile({}, *encodePixels(image, {0, 0, 16, 8}, PixelFormat::kRgba16f, codec));
}

TEST(Crc32c, MatchesThePublishedVectors) {
  const std::string_view digits = "123456789";  // the check value of CRC-32/ISCSI
  EXPECT_EQ(crc32c(std::span(reinterpret_cast<const std::uint8_t*>(digits.data()), digits.size())), 0xe3069283U);
  EXPECT_EQ(crc32c(Bytes(32, 0x00)), 0x8a9136aaU);  // RFC 3720 B.4
  EXPECT_EQ(crc32c(Bytes(32, 0xff)), 0x62a8ab43U);
  EXPECT_EQ(crc32c({}), 0U);
}

TEST(Half, EveryValueSurvivesTheWayThere) {
  for (std::uint32_t h = 0; h < 0x10000U; ++h) {
    const auto half = static_cast<std::uint16_t>(h);
    const float value = floatFromHalf(half);
    if (std::isnan(value)) continue;
    EXPECT_EQ(halfFromFloat(value), half) << value;
  }
  EXPECT_EQ(floatFromHalf(0x3c00), 1.0F);
  EXPECT_EQ(floatFromHalf(0x0001), 0x1p-24F);
  EXPECT_EQ(halfFromFloat(65504.0F), 0x7bff);
  EXPECT_EQ(halfFromFloat(1.0F + 0x1p-11F), 0x3c00) << "a tie goes to the even neighbour";
  EXPECT_EQ(halfFromFloat(1.0F + 3 * 0x1p-11F), 0x3c02);
}

TEST(TilePixels, HalfFloatsAreWithinTwoToTheMinusEleven) {
  std::mt19937 random(1);
  for (const float top : {-100.0F, -20.0F, -3.0F, 0.0F, 10.0F, 14.9F, 20.0F, 30.0F, 100.0F}) {
    const auto image = randomImage(random, 64, 64, top, 20.0F);
    const auto back = roundTrip(image, PixelFormat::kRgba16f);
    ASSERT_TRUE(back.has_value()) << back.error().text();
    for (std::size_t i = 0; i < image.pixels.size(); ++i)
      for (int c = 0; c < 3; ++c) {
        const float value = image.pixels[i][c];
        if (value < std::exp2(std::max(top, -8.0F) - 28.0F)) continue;  // subnormal when stored
        if (top < 15.0F && top > -8.0F && value < 0x1p-14F) continue;
        EXPECT_LE(std::abs(back->pixels[i][c] - value), value * 0x1p-11F) << value;
      }
  }
}

TEST(TilePixels, SharedExponentsAreWithinA511thOfTheLargestChannel) {
  std::mt19937 random(2);
  for (const float top : {-30.0F, 0.0F, 14.0F, 29.9F}) {
    const auto image = randomImage(random, 64, 64, top, 6.0F);
    const auto back = roundTrip(image, PixelFormat::kRgb9e5, Codec::kDeflate);
    ASSERT_TRUE(back.has_value()) << back.error().text();
    for (std::size_t i = 0; i < image.pixels.size(); ++i) {
      const auto& v = image.pixels[i];
      const float bound = std::max({v.x, v.y, v.z}) / 511.0F;
      for (int c = 0; c < 3; ++c) EXPECT_LE(std::abs(back->pixels[i][c] - v[c]), bound) << v[c];
    }
  }
}

TEST(TilePixels, FullFloatsAreExact) {
  std::mt19937 random(4);
  const auto image = randomImage(random, 33, 5, 120.0F, 240.0F);
  EXPECT_EQ(roundTrip(image, PixelFormat::kRgba32f)->pixels, image.pixels);
  EXPECT_EQ(roundTrip(image, PixelFormat::kRgba32f, Codec::kDeflate)->pixels, image.pixels);
}

TEST(TilePixels, AThousandMillionLuxDoesNotOverflow) {
  Image image(2, 2, glm::vec3(1e9F, 2.5F, 0.0F));
  for (const auto format : {PixelFormat::kRgba16f, PixelFormat::kRgb9e5, PixelFormat::kRgba32f}) {
    const auto back = roundTrip(image, format);
    ASSERT_TRUE(back.has_value());
    EXPECT_NEAR(back->at(0, 0).x, 1e9F, 1e9F * 0x1p-9F) << name(format);
  }
}

TEST(TilePixels, AnOrdinarySceneNeedsNoExponent) {
  Image image(4, 4, glm::vec3(500.0F));
  EXPECT_EQ(encodePixels(image, {0, 0, 4, 4}, PixelFormat::kRgba16f, Codec::kNone)->exponent, 0);
  EXPECT_EQ(encodePixels(Image(4, 4), {0, 0, 4, 4}, PixelFormat::kRgba16f, Codec::kNone)->exponent, 0);
}

TEST(TilePixels, WhatIsNotFiniteIsRefused) {
  for (const float bad : {kInfinity, -kInfinity, std::numeric_limits<float>::quiet_NaN()}) {
    Image image(4, 4, glm::vec3(1.0F));
    image.at(2, 3).y = bad;
    const auto encoded = encodePixels(image, {0, 0, 4, 4}, PixelFormat::kRgba16f, Codec::kNone);
    ASSERT_FALSE(encoded.has_value());
    EXPECT_THAT(encoded.error().message, testing::HasSubstr("(2, 3)"));
    EXPECT_TRUE(encodePixels(image, {0, 0, 2, 2}, PixelFormat::kRgba16f, Codec::kNone).has_value());
  }
}

TEST(TilePixels, NegativeAndSubnormalValuesAreKeptOrBecomeZero) {
  Image image(2, 1);
  image.at(0, 0) = {-4.0F, 1.0F, 1e-40F};
  image.at(1, 0) = glm::vec3(std::numeric_limits<float>::denorm_min());
  EXPECT_EQ(roundTrip(image, PixelFormat::kRgba16f)->at(0, 0), glm::vec3(-4.0F, 1.0F, 0.0F));
  EXPECT_EQ(roundTrip(image, PixelFormat::kRgb9e5)->at(0, 0), glm::vec3(0.0F, 1.0F, 0.0F));
  Image tiny(1, 1, glm::vec3(1e-40F));
  EXPECT_NEAR(roundTrip(tiny, PixelFormat::kRgba16f)->at(0, 0).x, 1e-40F, 1e-43F) << "the exponent reaches it";
}

TEST(TilePixels, IdsComeBackExactly) {
  std::vector<std::uint32_t> ids(std::size_t{64} * 64);
  for (std::size_t i = 0; i < ids.size(); ++i) ids[i] = static_cast<std::uint32_t>(i * 2654435761U);
  const auto pixels = encodeIds(ids, 64, 64, Codec::kDeflate);
  ASSERT_TRUE(pixels.has_value());
  EXPECT_EQ(*tileIds(*decodeTile(encodeTile({}, *pixels))), ids);
  EXPECT_FALSE(encodeIds(ids, 64, 63, Codec::kNone).has_value());
}

TEST(TilePixels, ARegionOutsideTheImageIsRefused) {
  const Image image(100, 100);
  for (const Region r : {Region{-1, 0, 4, 4}, Region{98, 0, 4, 4}, Region{0, 0, 65, 4}, Region{0, 0, 0, 4},
                         Region{std::numeric_limits<int>::max(), 0, 4, 4}})
    EXPECT_FALSE(encodePixels(image, r, PixelFormat::kRgba16f, Codec::kNone).has_value());
}

TEST(TileFrame, HeaderFieldsSurvive) {
  TileHeader h;
  h.page = 0x01020304;
  h.mip = 5;
  h.flags = kTileFinal | kTileReset;
  h.x = 0xfedcba98;
  h.y = 64;
  h.revision = 0x0102030405060708;
  h.tile_version = ~std::uint64_t{0};
  h.shots = 77;
  h.error = 0.02F;
  const Image image(3, 2, glm::vec3(70000.0F));
  const auto tile =
      decodeTile(encodeTile(h, *encodePixels(image, {0, 0, 3, 2}, PixelFormat::kRgba16f, Codec::kDeflate)));
  ASSERT_TRUE(tile.has_value()) << tile.error().text();
  const auto& got = tile->header;
  EXPECT_EQ(got.page, h.page);
  EXPECT_EQ(got.mip, h.mip);
  EXPECT_EQ(got.flags, h.flags);
  EXPECT_EQ(got.x, h.x);
  EXPECT_EQ(got.y, h.y);
  EXPECT_EQ(got.width, 3);
  EXPECT_EQ(got.height, 2);
  EXPECT_EQ(got.exponent, 2);
  EXPECT_EQ(got.revision, h.revision);
  EXPECT_EQ(got.tile_version, h.tile_version);
  EXPECT_EQ(got.shots, h.shots);
  EXPECT_EQ(got.error, h.error);
}

TEST(TileFrame, EveryUnsoundFieldIsRefusedByName) {
  struct Case {
    std::size_t offset;
    std::uint8_t value;
  };
  for (const auto [offset, value] :
       {Case{0, 'X'}, Case{4, 2}, Case{5, 9}, Case{6, 4}, Case{7, 2}, Case{12, 200}, Case{24, 0}, Case{24, 65},
        Case{25, 1}, Case{26, 0}, Case{31, 0x40}, Case{55, 0xff}, Case{56, 1}, Case{60, 0}, Case{70, 0x55}}) {
    auto frame = someFrame(Codec::kNone);
    frame[offset] = frame[offset] == value ? static_cast<std::uint8_t>(value + 1) : value;
    const auto tile = decodeTile(frame);
    EXPECT_FALSE(tile.has_value()) << "byte " << offset;
    if (!tile) {
      EXPECT_THAT(tile.error().where, testing::HasSubstr("tile frame, byte"));
    }
  }
}

TEST(TileFrame, TruncatedAndExtendedFramesAreRefused) {
  for (const auto codec : {Codec::kNone, Codec::kDeflate}) {
    const auto frame = someFrame(codec);
    for (std::size_t n = 0; n < frame.size(); ++n) EXPECT_FALSE(decodeTile(std::span(frame).first(n)).has_value()) << n;
    auto longer = frame;
    longer.push_back(0);
    EXPECT_FALSE(decodeTile(longer).has_value());
    longer[56] = static_cast<std::uint8_t>(longer[56] + 1);  // and the length says so too
    EXPECT_FALSE(decodeTile(longer).has_value());
  }
}

TEST(TileFrame, AnInfinityFromThePeerIsRefused) {
  EncodedPixels pixels;
  pixels.width = pixels.height = 1;
  pixels.payload = {0x00, 0x7c, 0, 0, 0, 0, 0x00, 0x3c};
  pixels.crc32c = crc32c(pixels.payload);
  const auto tile = decodeTile(encodeTile({}, pixels));
  ASSERT_TRUE(tile.has_value());
  EXPECT_FALSE(tileImage(*tile).has_value());
}

TEST(TileFrame, NoMutationCrashesTheDecoder) {
  std::mt19937 random(5);
  for (const auto codec : {Codec::kNone, Codec::kDeflate}) {
    const auto frame = someFrame(codec);
    for (int i = 0; i < 20'000; ++i) {
      auto mutant = frame;
      const int edits = 1 + static_cast<int>(random() % 4);
      for (int e = 0; e < edits; ++e) mutant[random() % mutant.size()] = static_cast<std::uint8_t>(random());
      if (random() % 8 == 0) mutant.resize(random() % (mutant.size() + 1));
      const auto tile = decodeTile(mutant);
      if (tile) {
        EXPECT_LE(tile->raw.size(), kMaxTileRawBytes);
      }
      if (tile && tile->header.format != PixelFormat::kR32ui) (void)tileImage(*tile);
    }
  }
}

}  // namespace
}  // namespace radiosity::protocol
