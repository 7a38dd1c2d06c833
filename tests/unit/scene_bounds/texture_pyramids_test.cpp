// Mip levels are made once for all materials that look at the same pictures alike, and of so many pixels at most.
#include "server/scene/texture_pyramids.h"

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

TEST(TexturePyramids, BeyondWhatMayBeMadeFewPixelsAreLookedAt) {
  const auto texture = checked(512);
  TexturePyramids pyramids(512 * 512);
  const auto whole = pyramids.of({.colour = &texture});
  PictureStack mask{.colour = &texture, .alpha = &texture, .is_mask = true};
  for (int i = 1; i <= 100; ++i) {
    mask.alpha_cutoff = 0.001F * static_cast<float>(i);
    EXPECT_LT(pyramids.of(mask)->bytes(), 64U * 64U * 16U);
  }
  EXPECT_EQ(pyramids.made(), 101U);
  EXPECT_EQ(pyramids.coarse(), 100U);
  const TextureUse use;
  EXPECT_NEAR(whole->sample(use, glm::vec2(0.5F), glm::vec2(1.0F)).r, 0.5F, 1e-3F);
}

}  // namespace
}  // namespace radiosity::scene
