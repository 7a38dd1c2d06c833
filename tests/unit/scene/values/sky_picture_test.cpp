// Pictures of skies: reduced, told apart, summed and drawn from without losing light.
#include "server/scene/values/sky_picture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace radiosity::scene {
namespace {

using std::numbers::pi;

/// Of radiance(direction), in the middles of texels.
template <typename Radiance>
SkyImage imageOf(std::size_t width, std::size_t height, const Radiance& radiance) {
  SkyImage image{width, height, {}};
  for (std::size_t y = 0; y < height; ++y) {
    for (std::size_t x = 0; x < width; ++x) {
      const double polar = (static_cast<double>(y) + 0.5) / static_cast<double>(height) * pi;
      const double azimuth = (2.0 * (static_cast<double>(x) + 0.5) / static_cast<double>(width) - 1.0) * pi;
      image.texels.push_back(glm::vec3(radiance(
          glm::dvec3(std::sin(polar) * std::cos(azimuth), std::cos(polar), std::sin(polar) * std::sin(azimuth)))));
    }
  }
  return image;
}

glm::dvec3 lightOf(const SkyImage& image) {
  glm::dvec3 sum(0.0);
  for (std::size_t y = 0; y < image.height; ++y) {
    const auto height = [&](std::size_t row) {
      return std::cos(pi * static_cast<double>(row) / static_cast<double>(image.height));
    };
    for (std::size_t x = 0; x < image.width; ++x)
      sum += 2.0 * pi / static_cast<double>(image.width) * (height(y) - height(y + 1)) *
             glm::dvec3(image.texels[y * image.width + x]);
  }
  return sum;
}

SkyImage reduced(const SkyImage& image, std::size_t width, std::size_t height) {
  SkyImageMaker maker(image.width, image.height, width, height);
  for (std::size_t y = 0; y < image.height; ++y)
    maker.addRow(std::span(image.texels).subspan(y * image.width, image.width));
  return maker.take();
}

const auto kSlope = [](const glm::dvec3& d) { return glm::dvec3(2.0 + d.y, 2.0 + d.x, 2.0 + d.z); };
const glm::dvec3 kSun = glm::normalize(glm::dvec3(0.4, 0.7, -0.3));
/// A degree wide, 1e5 times as bright as the sky around it.
const auto kSunny = [](const glm::dvec3& d) {
  return glm::dot(d, kSun) > std::cos(pi / 360.0) ? glm::dvec3(1e5, 9e4, 8e4) : glm::dvec3(1.0, 1.5, 2.0);
};

TEST(SkyImage, KeepsItsLightWhateverItIsReducedTo) {
  const auto image = imageOf(150, 70, kSlope);
  for (const auto& [width, height] :
       {std::pair(150U, 70U), std::pair(50U, 35U), std::pair(64U, 32U), std::pair(1U, 1U)}) {
    const auto small = reduced(image, width, height);
    EXPECT_EQ(small.width, width);
    EXPECT_EQ(small.height, height);
    EXPECT_LT(glm::distance(lightOf(small), lightOf(image)), 1e-5 * glm::length(lightOf(image))) << width;
  }
  EXPECT_EQ(reduced(image, 150, 70).texels, image.texels);
}

TEST(SkyPicture, OfOneColourHasNothingBright) {
  const SkyPicture sky(imageOf(64, 32, [](const glm::dvec3&) { return glm::dvec3(3.0); }));
  EXPECT_TRUE(sky.bright().empty());
  ASSERT_EQ(sky.whole().size(), 1U);
  EXPECT_NEAR(sky.whole()[0].light.x, 12.0 * pi, 1e-5);
  EXPECT_NEAR(sky.restOver(1.0, 0.7, -0.3, 0.5).y, 3.0, 1e-6);
  EXPECT_NEAR(sky.restOver(3.0, 7.0, -1.0, 2.0).y, 3.0, 1e-6) << "more than a turn";
  EXPECT_TRUE(sky.shines(true));
  EXPECT_TRUE(sky.shines(false));
}

TEST(SkyPicture, TellsTheSunApartAndKeepsAllLight) {
  const auto image = imageOf(1024, 512, kSunny);
  const SkyPicture sky(image);
  ASSERT_FALSE(sky.bright().empty());
  glm::dvec3 light = sky.restOver(-pi, 2.0 * pi, -1.0, 2.0) * 4.0 * pi;
  EXPECT_NEAR(light.x, 4.0 * pi, 0.05) << "the sky without the sun";
  for (const auto& lamp : sky.bright()) light += lamp.light;
  EXPECT_LT(glm::distance(light, lightOf(image)), 1e-4 * glm::length(lightOf(image)));
  glm::dvec3 whole(0.0);
  for (const auto& lamp : sky.whole()) whole += lamp.light;
  EXPECT_LT(glm::distance(whole, lightOf(image)), 1e-4 * glm::length(lightOf(image)));
  for (int i = 0; i < 256; ++i) {
    const auto drawn = skyDirection(*sky.bright()[0].table, {(i % 16 + 0.5) / 16.0, (i / 16 + 0.5) / 16.0});
    EXPECT_GT(glm::dot(drawn, kSun), std::cos(pi / 180.0));
  }
}

TEST(SkyPicture, SumsAnyRectangle) {
  const SkyPicture sky(imageOf(256, 128, kSlope));
  for (const double azimuth : {-3.0, -0.4, 2.2, 5.0}) {
    const double width = 0.6, height = 0.2, extent = 0.3;
    glm::dvec3 sum(0.0);
    constexpr int kCuts = 100;
    for (int i = 0; i < kCuts * kCuts; ++i) {
      const double a = azimuth + width * (i % kCuts + 0.5) / kCuts, y = height + extent * (i / kCuts + 0.5) / kCuts;
      sum += kSlope(glm::dvec3(std::sqrt(1 - y * y) * std::cos(a), y, std::sqrt(1 - y * y) * std::sin(a)));
    }
    EXPECT_LT(glm::distance(sky.restOver(azimuth, width, height, extent), sum / double{kCuts * kCuts}), 2e-3);
  }
}

// One lamp of what all channels share, and what is left by channel.
TEST(SkyPicture, OfManyColoursIsDrawnByChannel) {
  const auto image = imageOf(
      64, 32, [](const glm::dvec3& d) { return d.x > 0.0 ? glm::dvec3(5.0, 1.0, 0.0) : glm::dvec3(0.0, 1.0, 5.0); });
  const SkyPicture sky(image);
  ASSERT_GT(sky.whole().size(), 1U);
  glm::dvec3 from_front(0.0), all(0.0);
  for (const auto& lamp : sky.whole()) {
    all += lamp.light;
    int front = 0;
    for (int i = 0; i < 1024; ++i)
      front += skyDirection(*lamp.table, {(i % 32 + 0.5) / 32.0, (i / 32 + 0.5) / 32.0}).x > 0.0 ? 1 : 0;
    from_front += front / 1024.0 * lamp.light;
  }
  EXPECT_LT(glm::distance(all, lightOf(image)), 1e-4 * glm::length(all));
  EXPECT_NEAR(from_front.x / all.x, 1.0, 0.02);
  EXPECT_NEAR(from_front.z / all.z, 0.0, 0.02);
  EXPECT_NEAR(from_front.y / all.y, 0.5, 0.02);
}

TEST(SkyPicture, InterpolatesAcrossItsSeam) {
  const SkyPicture sky(imageOf(64, 32, kSlope));
  for (const auto& d :
       {glm::dvec3(-1, 0, 0), glm::dvec3(0, 1, 0), glm::dvec3(0.6, 0.0, 0.8), glm::dvec3(-0.8, -0.6, 0)})
    EXPECT_LT(glm::distance(glm::dvec3(sky.radiance(d)), kSlope(d)), 0.1);
}

TEST(SkyTable, IsDrawnFromInProportionAndChecked) {
  SkyGrid grid{8, 4, std::vector<float>(32, 0.0F)};
  grid.strength[1 * 8 + 2] = 3.0F;
  grid.strength[2 * 8 + 5] = 1.0F;  // of the same solid angle
  const auto table = skyTable(grid);
  ASSERT_TRUE(isSkyTable(table));
  int upper = 0;
  for (int i = 0; i < 1000; ++i) upper += skyDirection(table, {(i + 0.5) / 1000.0, 0.3}).y > 0.0 ? 1 : 0;
  EXPECT_NEAR(upper, 750, 2);
  EXPECT_TRUE(skyTable({4, 2, std::vector<float>(8, 0.0F)}).empty());
  auto cut = table;
  cut.pop_back();
  EXPECT_FALSE(isSkyTable(cut));
  EXPECT_FALSE(isSkyTable({}));
  auto falls = table;
  falls[4] = 2.0F;
  EXPECT_FALSE(isSkyTable(falls));
}

}  // namespace
}  // namespace radiosity::scene
