#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <utility>

#include "server/scene/shading/shade.h"
#include "server/scene/values/patch_scene.h"
#include "tests/unit/scene/built_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

Texture textureOf(int width, int height, const std::vector<std::uint8_t>& grey, bool srgb) {
  Texture texture;
  texture.width = width;
  texture.height = height;
  texture.srgb = srgb;
  for (const std::uint8_t g : grey) texture.rgba.insert(texture.rgba.end(), {g, g, g, 255});
  return texture;
}

/// One floor whose texture spans it once.
Scene texturedFloor(Texture texture, double size = 1.0) {
  Scene scene;
  scene.textures.push_back(std::move(texture));
  Primitive p = floorQuad(size);
  p.texcoord0 = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  Material material;
  material.base_color = glm::vec3(0.5F);
  material.base_color_texture.texture = 0;
  place(scene, p, glm::dmat4(1.0), material);
  return scene;
}

double meanReflectance(const PatchScene& patches, const PatchMaterials& materials) {
  double sum = 0.0, area = 0.0;
  for (const Surface& s : patches.surfaces)
    for (std::uint32_t n = s.first_node[0]; n < s.first_node[0] + s.width * s.height; ++n) {
      sum += static_cast<double>(materials.reflectance[n].x) * patches.node_area[n];
      area += patches.node_area[n];
    }
  return sum / area;
}

TEST(Shade, UniformMaterialFillsEveryNode) {
  Scene scene;
  Material material;
  material.base_color = {0.2F, 0.4F, 0.6F};
  material.metallic = 0.5F;
  material.emission = {1.0F, 2.0F, 3.0F};
  place(scene, floorQuad(1.0), glm::dmat4(1.0), material);
  const PatchScene patches = build(scene, 100);
  const PatchMaterials materials = shadePatches(scene, patches);
  for (std::uint32_t i = 0; i < patches.nodeCount(); ++i) {
    EXPECT_NEAR(materials.reflectance[i].y, 0.2, 1e-6);
    EXPECT_NEAR(materials.emission[i].z, 3.0 * M_PI, 1e-5);
  }
  EXPECT_TRUE(materials.warnings.empty());
}

/// Of a floor all of this.
PatchMaterials shadedFloor(const Material& material, std::uint64_t texels = 100) {
  Scene scene;
  place(scene, floorQuad(1.0), glm::dmat4(1.0), material);
  return shadePatches(scene, build(scene, texels));
}

TEST(Shade, MetalReflectsItsBaseColourAsAMirror) {
  Material material;
  material.base_color = {0.9F, 0.6F, 0.3F};
  material.metallic = 1.0F;
  material.roughness = 0.4F;
  const auto materials = shadedFloor(material);
  ASSERT_GT(materials.specular.sideCount(), 0U);
  EXPECT_EQ(materials.specular.side(0)[0], material.base_color);
  EXPECT_EQ(materials.lobe.side(0)[0], glm::vec3(0.4F, 1.0F, 0.0F));
  EXPECT_EQ(materials.reflectance.side(0)[0], glm::vec3(0.0F));
}

TEST(Shade, WhatACoatReflectsIsAPartOfTheDiffuseReflectance) {
  for (const float roughness : {0.0F, 0.5F}) {
    Material material;
    material.base_color = glm::vec3(0.5F);
    material.roughness = roughness;
    const auto materials = shadedFloor(material);
    EXPECT_EQ(materials.specular.sideCount(), 0U) << "nothing is to be kept for mirrors";
    EXPECT_EQ(materials.reflectance.side(0)[0], glm::vec3(0.5F));
  }
}

TEST(Shade, ATraceOfMetalReflectsDiffusely) {
  Material material;
  material.base_color = glm::vec3(0.5F);
  material.metallic = 0.09F;  // 0.045 of all light
  const auto materials = shadedFloor(material);
  EXPECT_EQ(materials.specular.side(0)[0], glm::vec3(0.0F));
  EXPECT_NEAR(materials.reflectance.side(0)[0].x, 0.5F, 1e-6F);
}

TEST(Shade, WhatGlassReflectsAndPassesIsToldByItsInterface) {
  Material material;
  material.base_color = glm::vec3(0.5F);
  material.transmission = 0.8F;
  material.roughness = 0.0F;
  material.double_sided = true;
  const auto materials = shadedFloor(material);
  EXPECT_NEAR(materials.specular.side(0)[0].x, 0.04F, 1e-6F);
  EXPECT_NEAR(materials.lobe.side(0)[0].z, 0.4F, 1e-6F) << "of what enters";
  // Of light from all around an interface reflects 0.04 + 0.96 / 21; of the rest 0.4 passes, and 0.2 x 0.5 is reflected
  // diffusely. The sum of 16 steps is that integral to 1 %.
  const float reflected = 0.04F + 0.96F / 21.0F;
  EXPECT_NEAR(materials.reflectance.side(0)[0].x, 0.5F * 0.2F * (1.0F - reflected) / (1.0F - 0.4F * (1.0F - reflected)),
              1e-3F);
}

// The metal's part of the light is neither reflected diffusely nor let through; alpha of the texture says how much
// passes.
TEST(Shade, TranslucentSurfacesShareTheirLightBetweenBothSides) {
  Scene scene;
  Texture half = textureOf(1, 1, {51}, true);
  half.rgba[3] = 102;  // of 255: 0.4
  scene.textures.push_back(half);
  Primitive floor = floorQuad(1.0);
  floor.texcoord0 = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  Material leaf;
  leaf.base_color = {0.2F, 0.4F, 0.6F};
  leaf.metallic = 0.25F;
  leaf.double_sided = true;
  leaf.diffuse_transmission = 0.5F;
  leaf.diffuse_transmission_color = {1.0F, 0.5F, 0.25F};
  leaf.diffuse_transmission_texture.texture = 0;
  place(scene, floor, glm::dmat4(1.0), leaf);
  const PatchScene patches = build(scene, 100);
  const PatchMaterials materials = shadePatches(scene, patches);
  ASSERT_EQ(patches.surfaces.size(), 1U);
  for (const auto first : patches.surfaces[0].first_node) {
    ASSERT_NE(first, kNone) << "both sides have patches, in the dark, too";
    EXPECT_NEAR(materials.base_reflectance[first].y, 0.75 * 0.4, 1e-6);
    EXPECT_NEAR(materials.reflectance[first].y, 0.75 * 0.4 * 0.8, 1e-6);
    EXPECT_NEAR(materials.transmittance[first].y, 0.75 * 0.5 * 0.2, 1e-6);
  }
}

TEST(Shade, ReflectanceAndTransmittanceAreLoweredTogether) {
  Scene scene;
  Material paper;
  paper.double_sided = true;
  paper.diffuse_transmission = 0.25F;
  place(scene, floorQuad(1.0), glm::dmat4(1.0), paper);
  const PatchScene patches = build(scene, 10);
  const PatchMaterials materials = shadePatches(scene, patches);
  EXPECT_NEAR(materials.reflectance[0].x, 0.75 * 0.999, 1e-6);
  EXPECT_NEAR(materials.transmittance[0].x, 0.25 * 0.999, 1e-6);
  EXPECT_THAT(materials.warnings, testing::ElementsAre(testing::HasSubstr("reflectance and transmittance")));
  EXPECT_EQ(shadePatches(sceneOf(floorQuad(1.0)), patches).transmittance.sideCount(), 0U) << "nothing is translucent";
}

// Something stands against the back of one leaf: a tenth of it is free, and no more light arrives to pass.
TEST(Shade, ALeafThatIsHalfCoveredPassesWhatArrivesOnTheRest) {
  Scene scene;
  Material paper;
  paper.double_sided = true;
  paper.base_color = glm::vec3(0.5F);
  paper.diffuse_transmission = 1.0F;
  paper.diffuse_transmission_color = glm::vec3(0.8F);
  place(scene, floorQuad(1.0), glm::dmat4(1.0), paper);
  PatchScene patches = build(scene, 10);
  const auto [front, back] = patches.surfaces.at(0).first_node;
  patches.node_area[back] *= 0.1F;
  const PatchMaterials materials = shadePatches(scene, patches);
  EXPECT_NEAR(materials.transmittance[front].x, 0.08F, 1e-6F);
  EXPECT_NEAR(materials.transmittance[front + 1].x, 0.8F, 1e-6F);
  EXPECT_NEAR(materials.transmittance[back].x, 0.8F, 1e-6F);
}

TEST(Shade, ReflectanceOfOneIsLoweredWithAWarning) {
  const Scene scene = sceneOf(floorQuad(1.0));
  const PatchScene patches = build(scene, 10);
  const PatchMaterials materials = shadePatches(scene, patches);
  for (std::uint32_t n = 0; n < patches.nodeCount(); ++n) EXPECT_EQ(materials.reflectance[n].x, 0.999F);
  EXPECT_THAT(materials.warnings, testing::ElementsAre(testing::HasSubstr("/materials/0")));
}

TEST(Shade, SrgbTexturesAreAveragedAsLight) {
  // A fine checkerboard of black and white is half the light, not sRGB 188's.
  std::vector<std::uint8_t> checker;
  for (int y = 0; y < 64; ++y)
    for (int x = 0; x < 64; ++x) checker.push_back((x + y) % 2 == 0 ? 255 : 0);
  const Scene scene = texturedFloor(textureOf(64, 64, checker, true));
  const PatchScene patches = build(scene, 16);
  const PatchMaterials materials = shadePatches(scene, patches);
  for (std::uint32_t n = 0; n < 16; ++n) EXPECT_NEAR(materials.reflectance[n].x, 0.25, 1e-3);
}

TEST(Shade, MeanOfAnOddSizedTextureIsKeptAtAnyResolution) {
  std::vector<std::uint8_t> values;
  double mean = 0.0;
  for (int i = 0; i < 37 * 53; ++i) {
    values.push_back(static_cast<std::uint8_t>((i * 7919) % 251));
    mean += 0.5 * values.back() / 255.0 / (37 * 53);
  }
  Scene scene = texturedFloor(textureOf(37, 53, values, false));
  for (const std::uint64_t budget : {1U, 9U, 400U, 40'000U}) {
    const PatchScene patches = build(scene, budget);
    EXPECT_NEAR(meanReflectance(patches, shadePatches(scene, patches)), mean, 0.01 * mean) << budget;
  }
}

/// A floor whose left half (u < 1/2) and right half have colours of their own.
Scene twoHalves(const std::array<std::uint8_t, 4>& left, const std::array<std::uint8_t, 4>& right, AlphaMode mode) {
  Scene scene;
  Texture texture;
  texture.width = 2;
  texture.height = 1;
  texture.srgb = false;
  for (const auto& half : {left, right}) texture.rgba.insert(texture.rgba.end(), half.begin(), half.end());
  scene.textures.push_back(std::move(texture));
  Primitive p = floorQuad(1.0);
  p.texcoord0 = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  Material material;
  material.base_color = glm::vec3(0.5F);
  material.alpha_mode = mode;
  material.base_color_texture.texture = 0;
  place(scene, p, glm::dmat4(1.0), material);
  return scene;
}

std::pair<float, float> reflectanceRange(const Scene& scene, std::uint64_t budget) {
  const PatchScene patches = build(scene, budget);
  const PatchMaterials materials = shadePatches(scene, patches);
  std::pair<float, float> range{1.0F, 0.0F};
  for (const Surface& s : patches.surfaces) {
    for (std::uint32_t n = s.first_node[0]; n < s.first_node[0] + s.width * s.height; ++n) {
      if (!(patches.node_area[n] > 0.0F)) continue;
      range = {std::min(range.first, materials.reflectance[n].x), std::max(range.second, materials.reflectance[n].x)};
    }
  }
  return range;
}

TEST(Shade, WhatIsCutOutOrClearLendsNoColourToWhatIsThere) {
  for (const auto mode : {AlphaMode::kMask, AlphaMode::kBlend}) {
    for (const std::uint8_t hidden : {0, 255}) {
      for (const bool nearest : {false, true}) {
        auto scene = twoHalves({204, 204, 204, 255}, {hidden, hidden, hidden, 0}, mode);
        scene.materials[0].base_color_texture.nearest = nearest;
        for (const std::uint64_t budget : {1U, 9U, 400U}) {
          const auto [low, high] = reflectanceRange(scene, budget);
          EXPECT_NEAR(low, 0.4F, 1e-5) << budget;
          EXPECT_NEAR(high, 0.4F, 1e-5) << budget;
        }
      }
    }
  }
}

TEST(Shade, BlendedColoursCountByTheirAlpha) {
  const auto scene = twoHalves({255, 255, 255, 51}, {0, 0, 0, 204}, AlphaMode::kBlend);
  const auto [low, high] = reflectanceRange(scene, 1);
  EXPECT_NEAR(low, 0.5F * 0.2F, 1e-3);  // a fifth of what is there is white
  EXPECT_EQ(low, high);
}

TEST(Shade, NearestKeepsTexelsApart) {
  auto scene = twoHalves({0, 0, 0, 255}, {255, 255, 255, 255}, AlphaMode::kOpaque);
  const PatchScene patches = build(scene, 400);
  const auto between = [&] {
    const PatchMaterials materials = shadePatches(scene, patches);
    std::uint32_t count = 0;
    for (std::uint32_t n = 0; n < patches.surfaces[0].width * patches.surfaces[0].height; ++n)
      count += materials.reflectance[n].x > 0.01F && materials.reflectance[n].x < 0.49F;
    return count;
  };
  EXPECT_GT(between(), 100U);  // half of the way from texel to texel, twice since it repeats
  scene.materials[0].base_color_texture.nearest = true;
  EXPECT_EQ(between(), 0U);  // the border is one of leaves, too
}

TEST(Shade, MetalIsReadWhereItsCoordinatesAre) {
  auto scene = twoHalves({255, 255, 0, 255}, {255, 255, 255, 255}, AlphaMode::kOpaque);
  auto& material = scene.materials[0];
  material.metallic_texture = std::exchange(material.base_color_texture, {});
  material.metallic_texture.nearest = true;
  material.metallic = 0.5F;
  const auto [low, high] = reflectanceRange(scene, 400);
  EXPECT_NEAR(low, 0.25F, 1e-6);
  EXPECT_NEAR(high, 0.5F, 1e-6);
  // Coordinates on the dielectric half alone.
  scene.primitives.edit(0, [](Primitive& p) { p.texcoord0 = {{0.1, 0}, {0.1, 1}, {0.4, 1}, {0.4, 0}}; });
  EXPECT_NEAR(reflectanceRange(scene, 400).first, 0.5F, 1e-6);
}

TEST(Shade, WhereWhiteIsMetalAndDielectricIsBlackNothingIsReflected) {
  std::vector<std::uint8_t> checker;
  for (int i = 0; i < 64 * 64; ++i) checker.push_back((i + i / 64) % 2 == 0 ? 255 : 0);
  auto scene = texturedFloor(textureOf(64, 64, checker, false));
  scene.materials[0].metallic = 1.0F;
  scene.materials[0].metallic_texture = scene.materials[0].base_color_texture;
  EXPECT_EQ(reflectanceRange(scene, 4).second, 0.0F) << "the product of two means would be a quarter";
}

TEST(Shade, SpecularTakesItsLargestChannelFromDiffuse) {
  auto scene = twoHalves({0, 51, 102, 255}, {255, 0, 0, 255}, AlphaMode::kOpaque);
  auto& material = scene.materials[0];
  material.specular_texture = std::exchange(material.base_color_texture, {});
  material.specular_texture.nearest = true;
  material.specular = {0.5F, 1.0F, 0.5F};
  const auto [low, high] = reflectanceRange(scene, 400);
  EXPECT_NEAR(low, 0.5F * 0.5F, 1e-6);
  EXPECT_NEAR(high, 0.5F * 0.8F, 1e-6);
}

TEST(Shade, ALampBehindACutOutShinesWithWhatIsLeftOfIt) {
  auto scene = twoHalves({255, 255, 255, 255}, {0, 0, 0, 0}, AlphaMode::kMask);
  auto& material = scene.materials[0];
  scene.textures.push_back(textureOf(2, 1, {102, 255}, false));  // bright where it is cut out
  material.emission = glm::vec3(1.0F);
  material.emissive_texture = material.base_color_texture;
  material.emissive_texture.texture = 1;
  const PatchScene patches = build(scene, 1);
  EXPECT_NEAR(shadePatches(scene, patches).emission[0].x, 0.4 * M_PI, 1e-5);
}

TEST(Shade, EmissiveTextureLightsOnlyItsPart) {
  Scene scene;
  scene.textures.push_back(textureOf(2, 1, {0, 255}, false));
  Primitive p = floorQuad(1.0);
  p.texcoord0 = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  Material material;
  material.emission = glm::vec3(2.0F);
  material.emissive_texture.texture = 0;
  material.emissive_texture.repeat_u = false;
  place(scene, p, glm::dmat4(1.0), material);
  const PatchScene patches = build(scene, 4096);
  const PatchMaterials materials = shadePatches(scene, patches);
  const LevelGrid top =
      levelGrid(patches.surfaces[0].width, patches.surfaces[0].height, patches.surfaces[0].level_count - 1);
  EXPECT_NEAR(materials.emission[top.offset].x, M_PI, 0.01);  // half of 2 pi
  float low = 1e9F, high = 0.0F;
  for (std::uint32_t n = 0; n < 4096; ++n) {
    low = std::min(low, materials.emission[n].x);
    high = std::max(high, materials.emission[n].x);
  }
  EXPECT_EQ(low, 0.0F);
  EXPECT_NEAR(high, 2.0 * M_PI, 1e-4);
}

// Lamps that shine alike all over are polygons, whatever colours and textures their reflectance has.
TEST(Shade, EmissionThatNothingChangesIsTheSameInEveryLeaf) {
  Primitive p = floorQuad(1.0);
  p.texcoord0 = {{0, 0}, {0, 3}, {5, 3}, {5, 0}};
  p.color0 = {{0.1F, 0.3F, 0.7F, 1}, {0.9F, 0.3F, 0.2F, 1}, {0.8F, 0, 0, 1}, {0.4F, 0.6F, 1, 1}};
  Material material;
  material.emission = {100.0F, 70.3F, 1.0F / 3.0F};
  for (const bool has_white : {false, true}) {
    Scene scene;
    scene.textures.push_back(textureOf(3, 1, {255, 255, 255}, true));
    if (has_white) material.emissive_texture.texture = 0;
    place(scene, p, glm::dmat4(1.0), material);
    const PatchScene patches = build(scene, 1000);
    const PatchMaterials materials = shadePatches(scene, patches);
    const float tolerance = has_white ? 1e-6F : 0.0F;  // means of a texture's pixels are rounded
    const auto& surface = patches.surfaces[0];
    ASSERT_GT(surface.width * surface.height, 900U);
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      for (int c = 0; c < 3; ++c) {
        const float whole = material.emission[c] * static_cast<float>(M_PI);
        EXPECT_NEAR(materials.emission[i][c], whole, tolerance * whole) << has_white << ' ' << i;
      }
    }
  }
}

TEST(Shade, VertexColoursAreInterpolatedAndMirroringKeepsTheirCorners) {
  Primitive p = floorQuad(1.0);
  p.color0 = {{0, 0, 0, 1}, {0, 0, 0, 1}, {0.8F, 0, 0, 1}, {0.8F, 0, 0, 1}};  // red grows with x
  for (const double sign : {1.0, -1.0}) {
    Scene scene;
    place(scene, p, glm::scale(glm::dmat4(1.0), glm::dvec3(sign, 1, 1)));
    const PatchScene patches = build(scene, 100);
    const PatchMaterials materials = shadePatches(scene, patches);
    for (std::uint32_t i = 0; i < 100; ++i) {
      const TriangleFrame& frame = patches.triangles[patches.leaves[i].triangle];
      const glm::vec3 unit = frame.origin + frame.du * patches.leaves[i].texel.x + frame.dv * patches.leaves[i].texel.y;
      const double x = unit.x * patches.scale + patches.centre.x;
      EXPECT_NEAR(materials.reflectance[i].x, 0.8 * x * sign, 1e-4);
    }
  }
}

TEST(Shade, ParentsAreAreaWeighted) {
  std::vector<std::uint8_t> values;
  for (int i = 0; i < 256; ++i) values.push_back(static_cast<std::uint8_t>(i));
  Scene scene;
  scene.textures.push_back(textureOf(16, 16, values, false));
  Primitive p;
  p.positions = {{0, 0, 0}, {0, 0, 1}, {1, 0, 0.3}};
  p.texcoord0 = {{0, 0}, {0, 1}, {1, 0.3}};
  p.indices = {0, 1, 2};
  Material material;
  material.base_color_texture.texture = 0;
  place(scene, p, glm::dmat4(1.0), material);
  const PatchScene patches = build(scene, 300);
  const PatchMaterials materials = shadePatches(scene, patches);
  const Surface& s = patches.surfaces[0];
  const LevelGrid top = levelGrid(s.width, s.height, s.level_count - 1);
  EXPECT_NEAR(materials.reflectance[s.first_node[0] + top.offset].x, meanReflectance(patches, materials), 1e-5);
}

TEST(Shade, ReshadingTouchesOnlyTheMaterialsSurfaces) {
  Scene scene;
  Material grey;
  grey.base_color = glm::vec3(0.5F);
  place(scene, floorQuad(1.0), glm::dmat4(1.0), grey);
  place(scene, box({2, 0, 0}, {3, 1, 1}), glm::dmat4(1.0), grey);
  const PatchScene patches = build(scene, 500);
  PatchMaterials materials = shadePatches(scene, patches);
  scene.materials[1].base_color = glm::vec3(0.25F);
  const std::vector<std::uint32_t> touched = reshadeMaterial(scene, patches, 1, materials);
  EXPECT_EQ(touched.size(), 6U);
  for (const Surface& surface : patches.surfaces)
    EXPECT_NEAR(materials.reflectance[surface.first_node[0]].x, surface.material == 1 ? 0.25 : 0.5, 1e-6);
  const PatchMaterials fresh = shadePatches(scene, patches);
  EXPECT_EQ(fresh.reflectance, materials.reflectance);
  EXPECT_EQ(fresh.emission, materials.emission);
}

}  // namespace
}  // namespace radiosity::scene::test
