// Mip levels are made once for all materials that look at the same pictures alike, and of so many pixels at most.
#include "server/scene/shading/texture_pyramids.h"

#include <gtest/gtest.h>

namespace radiosity::scene {
namespace {

Texture checked(int size) {
  Texture texture;
  texture.width = texture.height = size;
  for (int i = 0; i < size * size; ++i) {
    const auto value = static_cast<std::uint8_t>((i + i / size) % 2 == 0 ? 255 : 0);
    texture.rgba.insert(texture.rgba.end(), {value, 100, 0, static_cast<std::uint8_t>(i % 256)});
  }
  return texture;
}

TEST(TexturePyramids, AreSharedByThoseThatLookAlike) {
  const auto one = checked(128), other = checked(128);
  TexturePyramids pyramids;
  const auto first = pyramids.of({.colour = &one});
  EXPECT_NE(pyramids.of({.colour = &other}), first);
  EXPECT_NE(pyramids.of({.colour = &one, .alpha = &one}), first);
  EXPECT_NE(pyramids.of({.colour = &one, .metal = &other, .metal_factor = 0.5F}), first);
  EXPECT_EQ(pyramids.of({.colour = &one}), first);
  EXPECT_EQ(pyramids.made(), 4U);
  EXPECT_EQ(pyramids.coarse(), 0U);
}

TEST(TexturePyramids, AreSharedByCutoffsThatNoAlphaOfAByteTellsApart) {
  const auto texture = checked(128);
  TexturePyramids pyramids;
  const TextureUse use;
  for (int i = 0; i < 2'000; ++i) {
    PictureStack mask{.colour = &texture, .alpha = &texture, .is_mask = true};
    mask.alpha_factor = 0.7F;
    mask.alpha_cutoff = 0.7F * 0.0005F * static_cast<float>(i);
    const auto pyramid = pyramids.of(mask);
    if (i % 100 != 0) continue;
    std::size_t counting = 0;
    for (std::size_t pixel = 0; pixel < 128U * 128U; ++pixel)
      if (0.7F * (static_cast<float>(texture.rgba[4 * pixel + 3]) / 255.0F) >= mask.alpha_cutoff) ++counting;
    const auto look = pyramid->look(use, glm::vec2(0.5F), glm::vec2(1.0F));
    EXPECT_NEAR(look.coverage, static_cast<double>(counting) / (128.0 * 128.0), 1e-5) << mask.alpha_cutoff;
  }
  EXPECT_LE(pyramids.made(), 257U);
}

TEST(TexturePyramids, BeyondWhatMayBeMadeFewPixelsAreLookedAt) {
  const auto texture = checked(512);
  TexturePyramids pyramids(512 * 512);
  const auto whole = pyramids.of({.colour = &texture});
  PictureStack mask{.colour = &texture, .alpha = &texture, .is_mask = true};
  for (int i = 1; i <= 100; ++i) {
    mask.alpha_cutoff = (static_cast<float>(i) + 0.5F) / 255.0F;
    EXPECT_LT(pyramids.of(mask)->bytes(), 64U * 64U * 16U);
  }
  EXPECT_EQ(pyramids.made(), 101U);
  EXPECT_EQ(pyramids.coarse(), 100U);
  const TextureUse use;
  EXPECT_NEAR(whole->sample(use, glm::vec2(0.5F), glm::vec2(1.0F)).r, 0.5F, 1e-3F);
}

}  // namespace
}  // namespace radiosity::scene
