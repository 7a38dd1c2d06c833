#include "server/scene/document/png.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstdint>
#include <vector>

#include "common/task.h"
#include "server/scene/document/image_decode.h"

namespace radiosity::scene {
namespace {

/// Smooth in one part, noise in another: every filter is of use somewhere.
std::vector<std::uint8_t> pixelsOf(int width, int height, int channels) {
  std::vector<std::uint8_t> pixels;
  std::uint32_t state = 1;
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      for (int c = 0; c < channels; ++c) {
        state = state * 1664525U + 1013904223U;
        const bool is_smooth = (x / 16 + y / 16) % 2 == 0;
        pixels.push_back(static_cast<std::uint8_t>(is_smooth ? x * (c + 1) + 2 * y : state >> 24U));
      }
  return pixels;
}

void expectRoundTrip(int width, int height, int channels) {
  const auto pixels = pixelsOf(width, height, channels);
  const auto png = encodePng(width, height, channels, pixels);
  EXPECT_EQ(sniffImageType(png), "image/png");
  const auto read = decodeImage(png, std::size_t{1} << 26U, "test");
  ASSERT_TRUE(read) << read.error().text();
  ASSERT_EQ(read->width, width);
  ASSERT_EQ(read->height, height);
  for (std::size_t i = 0; i < pixels.size() / static_cast<std::size_t>(channels); ++i)
    for (std::size_t c = 0; c < 4; ++c) {
      const auto depth = static_cast<std::size_t>(channels);
      ASSERT_EQ(read->rgba[4 * i + c], c < depth ? pixels[depth * i + c] : 255) << "pixel " << i << " channel " << c;
    }
}

TEST(Png, IsReadBackAsItWas) {
  for (const int channels : {3, 4}) {
    expectRoundTrip(1, 1, channels);
    expectRoundTrip(63, 47, channels);
  }
}

TEST(Png, OfManyBandsIsOnePicture) { expectRoundTrip(1500, 700, 3); }

TEST(Png, OfOneRowThatIsLongerThanABandIsOnePicture) { expectRoundTrip(100'000, 3, 3); }

TEST(Png, CompressesWhatIsSmooth) {
  const std::vector<std::uint8_t> grey(std::size_t{3} * 512 * 512, 128);
  EXPECT_LT(encodePng(512, 512, 3, grey).size(), grey.size() / 100);
}

TEST(Png, IsGivenUpOnceItIsCalledOff) {
  Task task;
  const TaskScope scope(&task);
  task.cancel();
  EXPECT_THROW((void)encodePng(63, 47, 3, pixelsOf(63, 47, 3)), Interrupted);
}

/// What a decoder takes is known before it is asked: of a megabyte it may take ten seconds, or a gigabyte.
TEST(Images, AScanTooManyIsRefused) {
  const auto jpegOf = [](std::size_t scans) {
    Bytes jpeg = {0xFF, 0xD8, 0xFF, 0xC2, 0, 11, 8, 0, 64, 0, 64, 1, 1, 0x11, 0};
    for (std::size_t i = 0; i < scans; ++i) jpeg.insert(jpeg.end(), {0xFF, 0xDA, 0, 8, 1, 1, 0, 1, 63, 0, 0x7F});
    return jpeg;
  };
  EXPECT_TRUE(sizeOfImage(jpegOf(256), 1U << 20U, "test"));
  const auto refused = sizeOfImage(jpegOf(257), 1U << 20U, "test");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kTooLarge);
  EXPECT_EQ(decodeImage(jpegOf(257), 1U << 20U, "test").error().code, ErrorCode::kTooLarge);
}

TEST(Images, WhatLiesBehindAJpegIsNoScan) {
  Bytes jpeg = {0xFF, 0xD8, 0xFF, 0xC2, 0, 11, 8, 0, 64, 0, 64, 1, 1, 0x11, 0, 0xFF, 0xDA, 0, 8, 1, 1, 0, 1, 63, 0};
  jpeg.insert(jpeg.end(), {0x7F, 0xFF, 0xD9});  // its end, and then a film
  for (int i = 0; i < 1000; ++i) jpeg.insert(jpeg.end(), {0xFF, 0xDA, 0, 8});
  EXPECT_TRUE(sizeOfImage(jpeg, 1U << 20U, "test"));
}

/// A picture of one pixel with a hundred megabytes of nothing.
TEST(Images, ADecoderIsNotAskedForMoreThanThePixelsTake) {
  auto png = encodePng(1, 1, 3, std::vector<std::uint8_t>{1, 2, 3});
  EXPECT_TRUE(decodeImage(png, 1U << 20U, "test"));
  const std::vector<std::uint8_t> nothing(std::size_t{100} << 20U, 0);
  uLongf size = compressBound(nothing.size());
  Bytes bomb(8 + size);
  ASSERT_EQ(compress(bomb.data() + 8, &size, nothing.data(), nothing.size()), Z_OK);
  bomb.resize(8 + size);
  for (int i = 0; i < 4; ++i) bomb[static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(size >> (24 - 8 * i));
  for (std::size_t i = 0; i < 4; ++i) bomb[4 + i] = static_cast<std::uint8_t>("IDAT"[i]);
  bomb.insert(bomb.end(), 4, 0);         // no decoder of ours looks at the sum
  constexpr std::size_t kHead = 8 + 25;  // signature and IHDR
  png.resize(kHead);
  png.insert(png.end(), bomb.begin(), bomb.end());
  const auto refused = decodeImage(png, 1U << 20U, "test");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kTooLarge) << refused.error().text();
}

TEST(Images, PixelsOfSixteenBitsCountTwice) {
  const auto pngOf = [](std::uint8_t depth) {
    return Bytes{0x89, 'P', 'N', 'G', 0x0D, 0x0A, 0x1A, 0x0A,  0, 0, 0, 13, 'I', 'H', 'D', 'R', 0,
                 0,    0,   100, 0,   0,    0,    100,  depth, 6, 0, 0, 0,  0,   0,   0,   0};
  };
  EXPECT_TRUE(sizeOfImage(pngOf(8), 10'000, "test"));
  EXPECT_TRUE(sizeOfImage(pngOf(16), 20'000, "test"));
  const auto refused = sizeOfImage(pngOf(16), 19'999, "test");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kTooLarge);
}

}  // namespace
}  // namespace radiosity::scene
