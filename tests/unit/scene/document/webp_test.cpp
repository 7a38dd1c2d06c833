// EXT_texture_webp: pictures as the library's encoder makes them, and broken ones.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <webp/encode.h>

#include <random>

#include "server/scene/document/image_decode.h"
#include "server/scene/lightmap/lightmap.h"
#include "tests/unit/scene/compressed_meshes.h"
#include "tests/unit/scene/expect_refused.h"

namespace radiosity::scene {
namespace {

using test::addView;
using test::expectRefused;
using test::GltfBuilder;
using test::Json;
using testing::ElementsAre;
using testing::HasSubstr;

const Bytes kRedAndBlue = {255, 0, 0, 255, 0, 0, 255, 128};

Bytes encoded(const Bytes& rgba, int width, int height, bool lossless = true) {
  std::uint8_t* out = nullptr;
  const auto size = lossless ? WebPEncodeLosslessRGBA(rgba.data(), width, height, 4 * width, &out)
                             : WebPEncodeRGBA(rgba.data(), width, height, 4 * width, 80.0F, &out);
  const Bytes bytes(out, out + size);
  WebPFree(out);
  return bytes;
}

Bytes noise(int width, int height) {
  std::mt19937 random(3);
  Bytes rgba(static_cast<std::size_t>(4 * width * height));
  for (auto& byte : rgba) byte = static_cast<std::uint8_t>(random());
  return rgba;
}

/// Its emission is the picture.
GltfBuilder documentWith(const Bytes& webp) {
  GltfBuilder builder;
  const auto mesh = builder.square();
  builder.gltf["meshes"][mesh]["primitives"][0]["material"] = 0;
  builder.node({{"mesh", mesh}});
  builder.gltf["images"] = Json::array({{{"bufferView", addView(builder, webp)}, {"mimeType", "image/webp"}}});
  builder.gltf["textures"] = Json::array({{{"extensions", {{"EXT_texture_webp", {{"source", 0}}}}}}});
  builder.gltf["materials"] = Json::array({{{"emissiveFactor", {1, 1, 1}}, {"emissiveTexture", {{"index", 0}}}}});
  test::require(builder, "EXT_texture_webp");
  return builder;
}

TEST(Webp, isReadAsTheTexelsThatWereEncoded) {
  const auto scene = documentWith(encoded(kRedAndBlue, 2, 1)).scene();
  ASSERT_TRUE(scene) << scene.error().text();
  ASSERT_EQ(scene->textures.size(), 1U);
  EXPECT_EQ(scene->textures[0].rgba, kRedAndBlue);
  EXPECT_EQ(scene->textures[0].width, 2);
  EXPECT_TRUE(scene->textures[0].srgb);
  EXPECT_EQ(scene->materials.at(0).emissive_texture.texture, 0U);
}

TEST(Webp, lossyPicturesAreReadToo) {
  const Bytes grey(std::size_t{4} * 32 * 32, 128);
  const auto texture = decodeImage(encoded(grey, 32, 32, false), 1 << 20, "grey.webp");
  ASSERT_TRUE(texture) << texture.error().text();
  EXPECT_EQ(texture->width, 32);
  EXPECT_NEAR(texture->rgba[400], 128, 6);
}

TEST(Webp, goesBeforeThePictureForThoseWhoDoNotReadIt) {
  auto builder = documentWith(encoded(kRedAndBlue, 2, 1));
  builder.gltf["images"].push_back({{"bufferView", addView(builder, Bytes(9, 1))}, {"mimeType", "image/png"}});
  builder.gltf["textures"][0]["source"] = 1;
  const auto scene = builder.scene();
  ASSERT_TRUE(scene) << scene.error().text();
  EXPECT_EQ(scene->textures.at(0).rgba, kRedAndBlue);
}

TEST(Webp, isKeptInTheLitScene) {
  const auto webp = encoded(kRedAndBlue, 2, 1);
  const auto document = documentWith(webp).document();
  ASSERT_TRUE(document);
  const auto again = parseDocument("again.glb", *writeGlb(*document));
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ(*again->images.at(0), webp);
  EXPECT_EQ(again->gltf["images"][0]["mimeType"], "image/webp");
  EXPECT_EQ(again->gltf["textures"], document->gltf["textures"]);
  EXPECT_THAT(again->gltf["extensionsRequired"], ElementsAre("EXT_texture_webp"));
}

TEST(Webp, pixelsAreCountedBeforeTheyAreDecoded) {
  const auto builder = documentWith(encoded(noise(40, 30), 40, 30));
  ImportLimits limits;
  limits.max_image_pixels = 1199;
  expectRefused(builder, ErrorCode::kTooLarge, "/images/0", "40 x 30; the limit is 1199 pixels", limits);
  limits.max_image_pixels = 1200;
  EXPECT_TRUE(builder.scene(limits));
}

TEST(Webp, anIndexOfNoImageIsRefused) {
  auto builder = documentWith(encoded(kRedAndBlue, 2, 1));
  builder.gltf["textures"][0]["extensions"]["EXT_texture_webp"]["source"] = 4;
  expectRefused(builder, ErrorCode::kInvalidScene, "/textures/0/extensions/EXT_texture_webp/source", "has 1 entries");
}

TEST(Webp, animationsAreRefusedByName) {
  Bytes animated = {'R', 'I', 'F', 'F', 22, 0, 0, 0, 'W', 'E', 'B', 'P', 'V', 'P', '8', 'X', 10, 0,
                    0,   0,   2,   0,   0,  0, 1, 0, 0,   1,   0,   0,   0,   0,   0,   0,   0,  0};
  expectRefused(documentWith(animated), ErrorCode::kUnsupported, "/images/0", "animated");
}

TEST(Webp, brokenPicturesAreRefusedOrReadAndNothingElse) {
  std::mt19937 random(1);
  std::size_t refused = 0;
  for (const bool lossless : {true, false}) {
    const auto whole = encoded(noise(24, 24), 24, 24, lossless);
    for (std::size_t length = 12; length < whole.size(); length += 7) {
      const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
      expectRefused(documentWith(cut), ErrorCode::kBadInput, "/images/0", "image");
    }
    for (int i = 0; i < 1000; ++i) {
      auto broken = whole;
      for (int edits = 0; edits < 3; ++edits) broken[random() % broken.size()] = static_cast<std::uint8_t>(random());
      const auto texture = decodeImage(broken, 1 << 16, "broken.webp");
      refused += texture ? 0 : 1;
      EXPECT_TRUE(texture || !texture.error().message.empty());
    }
  }
  EXPECT_GT(refused, 20U);
}

}  // namespace
}  // namespace radiosity::scene
