#include "client/engines/encode.h"

#include <gtest/gtest.h>
#include <half.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "client/engines/lit_scene.h"
#include "tests/unit/client/temporary_folder.h"

namespace radiosity::engines {
namespace {

/// 3 x 2 texels, all different.
Image pageUpTo(float largest) {
  Image page(3, 2);
  for (std::size_t i = 0; i < page.pixels.size(); ++i)
    page.pixels[i] = glm::vec3(1.0F, 0.5F, 0.25F) * (largest * static_cast<float>(i + 1) / 6.0F);
  return page;
}

/// As readers of ours see it: what is stored times the unit.
Image readBack(const EncodedPage& encoded) {
  const TemporaryFolder folder;
  const auto glb = writeGlb(Json::object(), {});
  auto scene = readLitScene(folder.write("scene.glb", {glb->begin(), glb->end()}),
                            {folder.write("page.exr", {encoded.bytes.begin(), encoded.bytes.end()})});
  EXPECT_TRUE(scene) << scene.error().text();
  for (auto& pixel : scene->pages[0].pixels) pixel *= static_cast<float>(encoded.unit);
  return scene->pages[0];
}

TEST(Encode, unitsArePowersOfTwoThatMakeUseOfHalves) {
  EXPECT_EQ(unitFor(0.0F), 1.0);
  EXPECT_EQ(unitFor(1.0F), 1.0);
  EXPECT_EQ(unitFor(65504.0F), 1.0);
  EXPECT_EQ(unitFor(std::numeric_limits<float>::infinity()), 1.0);
  for (const float largest : {65505.0F, 1e9F, 0.9F, 1e-6F, 1e-30F}) {
    const double unit = unitFor(largest);
    int exponent = 0;
    EXPECT_EQ(std::frexp(unit, &exponent), 0.5) << largest;
    EXPECT_LE(largest / unit, 65504.0);
    EXPECT_GE(largest / unit, 8192.0);
  }
}

TEST(Encode, pagesComeBackToHalfAStepOfHalves) {
  for (const float largest : {1000.0F, 3e6F, 1e-4F}) {
    for (const auto encoding : {Encoding::kHalfExr, Encoding::kPlainHalfExr}) {
      const auto page = pageUpTo(largest);
      const auto encoded = encodePage(page, encoding);
      ASSERT_TRUE(encoded) << encoded.error().text();
      EXPECT_LT(std::sqrt(encoded->square_loss / encoded->square), std::ldexp(1.0, -11));
      const auto back = readBack(*encoded);
      ASSERT_EQ(back.width, page.width);
      for (std::size_t i = 0; i < page.pixels.size(); ++i)
        for (int c = 0; c < 3; ++c)
          EXPECT_NEAR(back.pixels[i][c], page.pixels[i][c], page.pixels[i][c] * std::ldexp(1.0F, -11)) << largest;
    }
  }
}

TEST(Encode, ddsHoldsRowsOfHalvesBehindItsHeader) {
  const auto page = pageUpTo(600.0F);
  const auto encoded = encodePage(page, Encoding::kHalfDds);
  ASSERT_TRUE(encoded);
  constexpr std::size_t kHeader = 128, kPixel = 8;
  ASSERT_EQ(encoded->bytes.size(), kHeader + page.pixels.size() * kPixel);
  EXPECT_EQ(std::memcmp(encoded->bytes.data(), "DDS ", 4), 0);
  for (std::size_t i = 0; i < page.pixels.size(); ++i) {
    std::array<half, 4> pixel{};
    std::memcpy(pixel.data(), encoded->bytes.data() + kHeader + i * kPixel, kPixel);
    EXPECT_NEAR(pixel[0], page.pixels[i].r, 0.1F);
    EXPECT_NEAR(pixel[2], page.pixels[i].b, 0.1F);
    EXPECT_EQ(pixel[3], 1.0F);
  }
}

TEST(Encode, whatIsNoLightIsBlack) {
  Image page(2, 1);
  page.pixels = {glm::vec3(-1.0F, std::numeric_limits<float>::quiet_NaN(), 2.0F),
                 glm::vec3(std::numeric_limits<float>::infinity(), 0.0F, 1.0F)};
  const auto encoded = encodePage(page, Encoding::kHalfExr);
  ASSERT_TRUE(encoded);
  const auto back = readBack(*encoded);
  EXPECT_EQ(back.pixels[0], glm::vec3(0.0F, 0.0F, 2.0F));
  EXPECT_EQ(back.pixels[1], glm::vec3(0.0F, 0.0F, 1.0F));
  EXPECT_EQ(encoded->square, 5.0);
}

}  // namespace
}  // namespace radiosity::engines
