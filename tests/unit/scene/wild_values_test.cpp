// Values that no sane exporter writes, and that a file may hold all the same: no lookup leaves its texture, and what
// comes of them is still an emission, a reflectance and an opacity.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <limits>

#include "server/scene/charts/build.h"
#include "server/scene/shading/opacity.h"
#include "server/scene/shading/shade.h"
#include "server/scene/values/patch_scene.h"
#include "server/scene/values/shade_texture.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

constexpr float kNan = std::numeric_limits<float>::quiet_NaN();
constexpr float kInfinity = std::numeric_limits<float>::infinity();
constexpr std::array kWild{0.3F, -7.75F, 99'999.5F, -3e9F, 1e20F, -3.4e38F, kInfinity, kNan};

Texture stripes(int width, int height) {
  Texture texture;
  texture.width = width;
  texture.height = height;
  for (int i = 0; i < width * height; ++i) {
    const auto value = static_cast<std::uint8_t>(i % 2 == 0 ? 255 : 0);
    texture.rgba.insert(texture.rgba.end(), {value, value, value, value});
  }
  return texture;
}

/// A lamp of 1 nit at most, textured, over which UVs run as they are given.
Scene lamp(AlphaMode mode, const std::array<glm::vec2, 4>& uvs, const TextureUse& use) {
  Scene scene;
  scene.textures = {stripes(16'384, 1), stripes(5, 3)};
  Primitive p = floorQuad(1.0);
  p.texcoord0.assign(uvs.begin(), uvs.end());
  p.color0 = {glm::vec4(kNan), glm::vec4(kInfinity), glm::vec4(1e38F), glm::vec4(-1e38F)};
  Material material;
  material.alpha_mode = mode;
  material.emission = glm::vec3(1.0F);
  material.base_color_texture = use;
  material.emissive_texture = use;
  place(scene, p, glm::dmat4(1.0), material);
  return scene;
}

void expectSane(const Scene& scene) {
  ChartOptions options;
  options.texel_budget = 16;
  const PatchScene patches = buildPatchScene(scene, options).value();
  const PatchMaterials materials = shadePatches(scene, patches);
  for (std::uint32_t i = 0; i < patches.nodeCount(); ++i) {
    ASSERT_GE(patches.node_area[i], 0.0F);
    for (int c = 0; c < 3; ++c) {
      ASSERT_TRUE(materials.reflectance[i][c] >= 0.0F && materials.reflectance[i][c] <= 0.999F);
      // no texture is brighter than white
      ASSERT_TRUE(materials.emission[i][c] >= 0.0F && materials.emission[i][c] <= 1.001F * static_cast<float>(M_PI));
    }
  }
}

TEST(WildValues, TextureCoordinatesOfAnySizeGiveLight) {
  for (const float a : kWild) {
    for (const float b : kWild) {
      SCOPED_TRACE(testing::Message() << a << " " << b);
      TextureUse use;
      use.texture = a < b ? 0 : 1;
      use.repeat_v = use.mirror_u = std::abs(a) > 1.0F;
      expectSane(lamp(AlphaMode::kBlend, {glm::vec2(a, b), {b, a}, {-a, b}, {0.5F, a}}, use));
      use.texture = 0;
      expectSane(lamp(AlphaMode::kMask, {glm::vec2(a, b), {a, b}, {a, b}, {a, b}}, use));  // no mip level blurs it
    }
  }
}

TEST(WildValues, TransformsOfAnySizeGiveLight) {
  const std::array<glm::vec2, 4> uvs{glm::vec2(0.0F), {0.0F, 1.0F}, {1.0F, 1.0F}, {1.0F, 0.0F}};
  for (const float a : kWild) {
    for (const float b : kWild) {
      SCOPED_TRACE(testing::Message() << a << " " << b);
      TextureUse use;
      use.texture = 0;
      use.scale = {a, b};
      expectSane(lamp(AlphaMode::kBlend, uvs, use));
      use.rotation = b;
      use.offset = {b, a};
      expectSane(lamp(AlphaMode::kMask, uvs, use));
    }
  }
}

TEST(WildValues, AFarRepeatOfATextureIsLikeTheFirst) {
  // In [0, 1] the alphas are 1 and 0 by turns: what lies beyond would be a lookup that mixes pixels far from its place.
  const Texture texture = stripes(16'384, 1);
  TextureUse use;
  const PlainTexture alpha(texture, use);
  for (const float u : kWild) {
    const float here = alpha.alphaAt({u, 0.5F});
    EXPECT_TRUE(here >= 0.0F && here <= 1.0F) << u << ": " << here;
  }
  // Whole numbers, from the first to those beyond any integer, are the seam between the last pixel and the first.
  for (const float u : {1.0F, 64.0F, 99'999.0F, 131'072.0F, 1e9F, 1e20F, -3e38F}) {
    EXPECT_EQ(alpha.alphaAt({u, 0.5F}), alpha.alphaAt({0.0F, 0.5F})) << u;
  }
  EXPECT_EQ(alpha.alphaAt({70'000.5F, 0.5F}), alpha.alphaAt({0.5F, 0.5F}));
  use.repeat_u = false;  // the last pixel goes on for ever
  EXPECT_EQ(alpha.alphaAt({3e38F, 0.5F}), 0.0F);
  EXPECT_EQ(alpha.alphaAt({-3e38F, 0.5F}), 1.0F);
}

TEST(WildValues, AFootprintThatIsNoNumberIsAPoint) {
  const Texture texture = stripes(16, 1);
  const TexturePyramid pyramid(texture);
  const glm::vec2 pixel(0.5F / 16.0F, 0.5F);
  const auto point = pyramid.sample({}, pixel, glm::vec2(0.0F));
  EXPECT_EQ(point.x, 1.0F);
  EXPECT_EQ(pyramid.sample({}, pixel, glm::vec2(kNan)), point);
  EXPECT_NEAR(pyramid.sample({}, pixel, glm::vec2(kInfinity, 0.0F)).x, 0.5F, 1e-6F);  // the mean of all
}

TEST(WildValues, ASpeckOfAnySizeHasAFrameOrIsLeftOut) {
  // Beside a floor of a unit's width, around its middle; from half of it down to where doubles hold nothing of it.
  ChartOptions options;
  options.texel_budget = 16;
  for (double size = 0.5; size > 1e-30; size *= 0.2) {
    SCOPED_TRACE(size);
    Scene scene;
    place(scene, floorQuad(1.0, -0.5, -0.5));
    Primitive speck;
    speck.positions = {{-0.5, 0.0, 0.0}, {-0.5, -0.7 * size, 0.71 * size}, {-0.5, size, -0.2 * size}};
    speck.indices = {0, 1, 2};
    place(scene, speck);
    const PatchScene patches = buildPatchScene(scene, options).value();
    EXPECT_EQ(patches.triangles.size(), size > 2e-13 ? 3U : 2U);
    for (const auto& frame : patches.triangles)
      for (const auto& v : {frame.origin, frame.du, frame.dv, frame.normal})
        ASSERT_TRUE(std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z));
  }
}

}  // namespace
}  // namespace radiosity::scene::test
