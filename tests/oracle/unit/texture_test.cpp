#include "tests/oracle/texture.h"

#include <gtest/gtest.h>

namespace radiosity::oracle {
namespace {

/// One row of greys.
Texture row(std::vector<std::uint8_t> greys) {
  Image image{static_cast<int>(greys.size()), 1, {}};
  for (const auto grey : greys) image.rgba.insert(image.rgba.end(), {grey, grey, grey, grey});
  return {std::make_shared<const Image>(std::move(image))};
}

TEST(Texture, PixelsHaveTheirCentresAtHalfIntegersAndAreMixedBetweenThem) {
  const auto texture = row({0, 255});
  EXPECT_EQ(texture.value({0.25, 0.5}).x, 0.0);
  EXPECT_EQ(texture.value({0.75, 0.5}).x, 1.0);
  EXPECT_EQ(texture.value({0.5, 0.5}).x, 0.5);
  EXPECT_EQ(texture.value({0.375, 0.5}).x, 0.25);
}

// Light is mixed, not its code: half black and half white is 0.5, where the code 0.5 would be 0.21.
TEST(Texture, ColoursAreLinearBeforeTheyAreMixedAndAlphaIsAsStored) {
  EXPECT_EQ(row({0, 255}).colour({0.5, 0.5}).x, 0.5);
  const auto grey = row({128}).colour({0.5, 0.5});
  EXPECT_NEAR(grey.x, 0.21586, 1e-5);
  EXPECT_NEAR(grey.w, 128.0 / 255.0, 1e-12);
}

TEST(Texture, NearestHoldsOverTheWholePixel) {
  auto texture = row({0, 255});
  texture.nearest = true;
  EXPECT_EQ(texture.value({0.499, 0.5}).x, 0.0);
  EXPECT_EQ(texture.value({0.501, 0.5}).x, 1.0);
  EXPECT_EQ(texture.value({-0.1, 0.5}).x, 1.0);
}

TEST(Texture, WrapsAsItsSamplerSays) {
  auto texture = row({0, 0, 0, 255});
  const auto at = [&](double u) { return texture.value({u, 0.5}).x; };
  EXPECT_EQ(at(1.875), 1.0);  // repeated
  EXPECT_EQ(at(-0.125), 1.0);
  EXPECT_EQ(at(1.0), 0.5);  // mixed with the first pixel
  texture.wrap_u = Texture::Wrap::kClamp;
  EXPECT_EQ(at(1.5), 1.0);
  EXPECT_EQ(at(-3.0), 0.0);
  EXPECT_EQ(at(1.0), 1.0);
  texture.wrap_u = Texture::Wrap::kMirror;
  EXPECT_EQ(at(1.125), 1.0);
  EXPECT_EQ(at(1.375), 0.0);
  EXPECT_EQ(at(2.875), 1.0);
  EXPECT_EQ(at(3.875), 0.0);
}

}  // namespace
}  // namespace radiosity::oracle
