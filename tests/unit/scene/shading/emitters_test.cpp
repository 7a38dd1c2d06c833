// Which surfaces emit, and that of faces which lie on each other the one that does is seen.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <glm/ext/matrix_transform.hpp>

#include "server/scene/shading/emitters.h"
#include "tests/unit/scene/built_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

Material glowing() {
  Material material;
  material.emission = glm::vec3(10.0F);
  return material;
}

/// Its left half is black, its right half is white.
Texture halfWhite() {
  Texture texture;
  texture.width = 16;
  texture.height = 4;
  for (int i = 0; i < 64; ++i) {
    const auto value = static_cast<std::uint8_t>(i % 16 < 8 ? 0 : 255);
    texture.rgba.insert(texture.rgba.end(), {value, value, value, 255});
  }
  return texture;
}

/// A quad whose UVs span u from `low` to `high`.
Primitive withUvs(float low, float high) {
  auto quad = floorQuad(1.0);
  quad.texcoord0 = {{low, 0.0F}, {low, 1.0F}, {high, 1.0F}, {high, 0.0F}};
  return quad;
}

glm::dmat4 at(double x, double z) { return glm::translate(glm::dmat4(1.0), glm::dvec3(x, 0, z)); }

TEST(Emitters, OfFacesInOnePlaceTheOneThatEmitsIsSeenWhereverItStandsInTheFile) {
  for (const bool lamp_first : {false, true}) {
    Scene scene;
    if (lamp_first) place(scene, floorQuad(1.0), at(1.0, 1.0), glowing());
    const auto floor = place(scene, floorQuad(4.0));
    if (!lamp_first) place(scene, floorQuad(1.0), at(1.0, 1.0), glowing());
    const PatchScene patches = build(scene, 1'600);
    EXPECT_NEAR(areaOf(patches, 0, 1 - floor), 1.0, 1e-3) << lamp_first;
    EXPECT_NEAR(areaOf(patches, 0, floor), 15.0, 0.05) << lamp_first;  // leaves at the lamp's edge: 64 places each
  }
}

TEST(Emitters, WhatDoesNotEmitIsSeenAsBefore) {
  Scene scene;
  place(scene, floorQuad(4.0));
  place(scene, floorQuad(1.0), at(1.0, 1.0));
  const PatchScene patches = build(scene, 1'600);
  EXPECT_NEAR(areaOf(patches, 0, 0), 16.0, 1e-3);
  EXPECT_NEAR(areaOf(patches, 0, 1), 0.0, 1e-3);
}

TEST(Emitters, OfTwoLampsInOnePlaceTheEarlierIsSeen) {
  Scene scene;
  place(scene, floorQuad(2.0), glm::dmat4(1.0), glowing());
  place(scene, floorQuad(2.0), glm::dmat4(1.0), glowing());
  const PatchScene patches = build(scene, 400);
  EXPECT_NEAR(areaOf(patches, 0, 0), 4.0, 1e-3);
  EXPECT_NEAR(areaOf(patches, 0, 1), 0.0, 1e-3);
}

// An opaque wall comes before a decal that one can see through, but not before one that shines.
TEST(Emitters, ALampThatOneCanSeeThroughComesBeforeAnOpaqueFace) {
  auto veil = glowing();
  veil.alpha_mode = AlphaMode::kBlend;
  veil.alpha = 0.5F;
  Scene scene;
  place(scene, floorQuad(2.0));
  place(scene, floorQuad(2.0), glm::dmat4(1.0), veil);
  const PatchScene patches = build(scene, 400);
  EXPECT_NEAR(areaOf(patches, 0, 0), 0.0, 1e-3);
  EXPECT_NEAR(areaOf(patches, 0, 1), 0.5 * 4.0, 0.01);  // alpha times its area, in 255 steps
}

TEST(Emitters, WhereTheEmissiveTextureIsBlackTheSurfaceDoesNotEmit) {
  Scene scene;
  scene.textures.push_back(std::make_shared<const Texture>(halfWhite()));
  auto material = glowing();
  material.emissive_texture.texture = 0;
  struct Case {
    float low, high;
    bool emits;
  };
  // The bilinear lookup at 0.5 mixes both halves.
  const std::vector<Case> cases = {{0.05F, 0.4F, false},  {0.6F, 0.9F, true},   {0.3F, 0.7F, true}, {1.1F, 1.4F, false},
                                   {-0.9F, -0.6F, false}, {-0.4F, -0.1F, true}, {0.1F, 5.0F, true}};
  for (std::size_t i = 0; i < cases.size(); ++i)
    place(scene, withUvs(cases[i].low, cases[i].high), at(2.0 * static_cast<double>(i), 0.0), material);
  const PatchScene patches = build(scene, 400);
  for (const Surface& surface : patches.surfaces)
    EXPECT_EQ(surface.emits, cases[surface.instance].emits) << cases[surface.instance].low;
}

TEST(Emitters, MirroredTexturesAreReadBackwardsInEveryOtherTile) {
  Scene scene;
  scene.textures.push_back(std::make_shared<const Texture>(halfWhite()));
  auto material = glowing();
  material.emissive_texture.texture = 0;
  material.emissive_texture.mirror_u = true;
  place(scene, withUvs(1.1F, 1.4F), glm::dmat4(1.0), material);  // as 0.6 to 0.9
  place(scene, withUvs(1.6F, 1.9F), at(2.0, 0.0), material);     // as 0.1 to 0.4
  place(scene, withUvs(2.1F, 2.4F), at(4.0, 0.0), material);     // as it stands
  const PatchScene patches = build(scene, 400);
  for (const Surface& surface : patches.surfaces) EXPECT_EQ(surface.emits, surface.instance == 0) << surface.instance;
}

TEST(Emitters, UvsThatAreNoNumbersCountAsTheWholeTexture) {
  Scene scene;
  scene.textures.push_back(std::make_shared<const Texture>(halfWhite()));
  auto material = glowing();
  material.emissive_texture.texture = 0;
  place(scene, withUvs(std::numeric_limits<float>::quiet_NaN(), 1e30F), glm::dmat4(1.0), material);
  const PatchScene patches = build(scene, 400);
  EXPECT_TRUE(patches.surfaces.at(0).emits);
}

TEST(Emitters, WhatTheFactorTakesFromTheTextureDoesNotEmit) {
  Scene scene;
  Texture red;
  red.width = red.height = 1;
  red.rgba = {255, 0, 0, 255};
  scene.textures.push_back(std::make_shared<const Texture>(red));
  auto material = glowing();
  material.emissive_texture.texture = 0;
  for (const auto& factor : {glm::vec3(0.0F, 5.0F, 5.0F), glm::vec3(1.0F, 0.0F, 0.0F)}) {
    material.emission = factor;
    place(scene, withUvs(0.0F, 1.0F), at(scene.instances.size() * 2.0, 0.0), material);
  }
  const PatchScene patches = build(scene, 400);
  for (const Surface& surface : patches.surfaces) EXPECT_EQ(surface.emits, surface.instance == 1);
}

/// A floor under a poster that is black and one that glows, both of one material. Instances 0 to 2.
Scene posters(bool apart) {
  Scene scene;
  scene.textures.push_back(std::make_shared<const Texture>(halfWhite()));
  auto material = glowing();
  material.emissive_texture.texture = 0;
  place(scene, floorQuad(4.0));
  auto both = withUvs(0.05F, 0.4F);
  const auto height = apart ? 0.5 : 0.0;
  addQuad(both, {2, height, 2}, {2, height, 3}, {3, height, 3}, {3, height, 2});
  both.texcoord0.insert(both.texcoord0.end(), {{0.6F, 0.0F}, {0.6F, 1.0F}, {0.9F, 1.0F}, {0.9F, 0.0F}});
  place(scene, std::move(both), glm::translate(glm::dmat4(1.0), glm::dvec3(0, height, 0)), material);
  return scene;
}

TEST(Emitters, WhoDrawsFacesThatLieOnEachOtherIsToldWhichOfAMaterialAreDark) {
  const auto scene = posters(false);
  const DarkOfEmitters dark(scene, build(scene, 1'600));
  for (std::size_t t = 0; t < 4; ++t) EXPECT_EQ(dark.has(1, t), t < 2) << t;
  EXPECT_FALSE(dark.has(0, 0)) << "its material does not emit anywhere";
  EXPECT_FALSE(dark.has(7, 0));
  const auto hovering = posters(true);
  EXPECT_EQ(DarkOfEmitters(hovering, build(hovering, 1'600)), DarkOfEmitters());
}

}  // namespace
}  // namespace radiosity::scene::test
