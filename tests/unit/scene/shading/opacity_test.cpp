#include "server/scene/shading/opacity.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <glm/ext/matrix_transform.hpp>
#include <glm/geometric.hpp>

#include "tests/unit/scene/built_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

/// A floor of side 1 whose texture, `width` x `height` alphas, spans it once.
Scene veiledFloor(AlphaMode mode, int width, int height, const std::vector<std::uint8_t>& alphas) {
  Scene scene;
  Texture texture;
  texture.width = width;
  texture.height = height;
  for (const auto alpha : alphas) texture.rgba.insert(texture.rgba.end(), {255, 255, 255, alpha});
  scene.textures.push_back(std::move(texture));
  Primitive p = floorQuad(1.0);
  p.texcoord0 = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  Material material;
  material.alpha_mode = mode;
  material.base_color_texture.texture = 0;
  place(scene, p, glm::dmat4(1.0), material);
  return scene;
}

/// Areas of all leaves of the first side.
double leafArea(const PatchScene& patches) {
  double sum = 0.0;
  for (const auto& s : patches.surfaces) {
    for (std::uint32_t i = 0; i < s.width * s.height; ++i)
      sum += static_cast<double>(patches.node_area[s.first_node[0] + i]);
  }
  return sum * patches.scale * patches.scale;
}

TEST(Opacity, OpaqueScenesHaveNoneAndKeepTheirArea) {
  Scene scene;
  place(scene, floorQuad(1.0), glm::dmat4(1.0), Material{});
  const auto patches = build(scene, 64);
  EXPECT_TRUE(patches.opacity.empty());
  EXPECT_NEAR(leafArea(patches), 1.0, 1e-5);
}

TEST(Opacity, AlphaOfAnOpaqueMaterialMeansNothing) {
  const auto patches = build(veiledFloor(AlphaMode::kOpaque, 1, 1, {0}), 64);
  EXPECT_TRUE(patches.opacity.empty());
  EXPECT_NEAR(leafArea(patches), 1.0, 1e-5);
}

TEST(Opacity, AMaskCutsOutWhatIsBelowTheCutoff) {
  // left half cut out; the bilinear step in the middle is cut at one half, where the border is
  const auto patches = build(veiledFloor(AlphaMode::kMask, 2, 1, {0, 255}), 64);
  ASSERT_EQ(patches.surfaces.size(), 1U);
  EXPECT_TRUE(patches.surfaces[0].see_through);
  // The texture repeats: a quarter of a pixel's blend at both outer borders is symmetrical, so half is left.
  EXPECT_NEAR(leafArea(patches), 0.5, 0.03);
  std::uint32_t empty = 0;
  for (const auto& leaf : patches.leaves) empty += leaf.triangle == kNone ? 1 : 0;
  EXPECT_GT(empty, patches.leaves.size() / 4) << "what is wholly cut out has no patches";
}

TEST(Opacity, AMaskThatCutsEverythingLeavesNoArea) {
  const auto patches = build(veiledFloor(AlphaMode::kMask, 1, 1, {100}), 64);
  EXPECT_EQ(leafArea(patches), 0.0);
}

TEST(Opacity, BlendedAreaIsAlphaTimesTheWhole) {
  const auto patches = build(veiledFloor(AlphaMode::kBlend, 1, 1, {51}), 64);
  EXPECT_NEAR(leafArea(patches), 0.2, 1e-3);
}

// A leaf's area is that of light from all around, of which an interface reflects 0.04 + 0.96 / 21.
TEST(Opacity, TransmissionLetsItsFactorOfWhatIsNotReflectedThrough) {
  Scene scene;
  Material glass;
  glass.transmission = 0.75F;
  place(scene, floorQuad(1.0), glm::dmat4(1.0), glass);
  EXPECT_NEAR(leafArea(build(scene, 64)), 1.0 - 0.75 * (1.0 - 0.04 - 0.96 / 21.0), 2e-3);  // kept in steps of 1/255
}

TEST(Opacity, WithoutAnInterfaceTransmissionLetsItsFactorThroughWhateverTheMode) {
  for (const auto mode : {AlphaMode::kOpaque, AlphaMode::kBlend}) {
    Scene scene;
    Material clear;
    clear.transmission = 0.75F;
    clear.ior = 1.0F;
    clear.alpha_mode = mode;
    place(scene, floorQuad(1.0), glm::dmat4(1.0), clear);
    EXPECT_NEAR(leafArea(build(scene, 64)), 0.25, 2e-3);
  }
}

/// A pane of glass of this colour, under a texture of pixels in a row, RGB, that spans it once.
Scene pane(const glm::vec3& colour, const std::vector<std::array<std::uint8_t, 3>>& pixels, bool are_a_mask) {
  Scene scene;
  Texture texture;
  texture.width = static_cast<int>(pixels.size());
  texture.height = 1;
  texture.srgb = false;
  for (const auto& pixel : pixels) texture.rgba.insert(texture.rgba.end(), {pixel[0], pixel[1], pixel[2], 255});
  Primitive p = floorQuad(1.0);
  p.texcoord0 = {{0, 0}, {0, 1}, {1, 1}, {1, 0}};
  Material glass;
  glass.base_color = colour;
  glass.transmission = 1.0F;
  if (!pixels.empty()) {
    scene.textures.push_back(std::move(texture));
    auto& use = are_a_mask ? glass.transmission_texture : glass.base_color_texture;
    use.texture = 0;
    use.nearest = true;
  }
  place(scene, p, glm::dmat4(1.0), glass);
  return scene;
}

TEST(Opacity, ClearGlassHasNoTint) {
  const auto patches = build(pane(glm::vec3(0.5F), {}, false), 64);
  EXPECT_TRUE(patches.tints.empty());
  EXPECT_TRUE(patches.leaf_tints.empty());
  EXPECT_EQ(patches.surfaces[0].first_tint, kNone);
  EXPECT_NEAR(patches.opacity[0], 255.0 * (1.0 - 0.96 * 0.5), 1.0);
}

TEST(Opacity, OfColouredGlassTheChannelPassesThatDoesBest) {
  const auto patches = build(pane({0.2F, 0.8F, 0.4F}, {}, false), 64);
  ASSERT_EQ(patches.surfaces[0].first_tint, 0U);
  EXPECT_NEAR(patches.opacity[0], 255.0 * (1.0 - 0.96 * 0.8), 1.0);
  const auto tint = patches.tintAt(patches.surfaces[0], {1.0F, 1.0F});
  EXPECT_NEAR(tint.r, 0.25F, 0.003F);
  EXPECT_EQ(tint.g, 1.0F);
  EXPECT_NEAR(tint.b, 0.5F, 0.003F);
  for (const auto& leaf : patches.leaf_tints) EXPECT_LT(glm::distance(leaf, tint), 1e-5F);
}

// Rays pass each half alike, so that of all that pass half has each colour.
TEST(Opacity, ALeafOfTwoColoursHasTheirMean) {
  std::vector<std::array<std::uint8_t, 3>> stripes;
  for (int i = 0; i < 64; ++i)
    stripes.push_back(i % 2 == 0 ? std::array<std::uint8_t, 3>{255, 0, 0} : std::array<std::uint8_t, 3>{0, 0, 255});
  const auto patches = build(pane(glm::vec3(1.0F), stripes, false), 16);
  const auto& surface = patches.surfaces[0];
  ASSERT_NE(surface.first_tint, kNone);
  ASSERT_GE(surface.opacity_scale, 16U);
  for (const auto& leaf : patches.leaf_tints) EXPECT_LT(glm::distance(leaf, glm::vec3(0.5F, 0.0F, 0.5F)), 0.02F);
  const auto at = [&](float pixel) {
    return patches.tintAt(surface, {static_cast<float>(surface.width) * (pixel + 0.5F) / 64.0F, 0.5F});
  };
  EXPECT_EQ(at(20.0F), glm::vec3(1.0F, 0.0F, 0.0F));
  EXPECT_EQ(at(21.0F), glm::vec3(0.0F, 0.0F, 1.0F));
}

// Cells that a triangle touches without their middles have the tint of the next; cells of tints are counted from the
// first coloured pane on, those of opacity from the first cut-out.
TEST(Opacity, APaneBehindACutOutHasItsOwnCells) {
  auto scene = veiledFloor(AlphaMode::kMask, 64, 1, std::vector<std::uint8_t>(64, 255));
  Primitive triangle = floorQuad(1.0);
  triangle.indices = {0, 1, 2};
  Material glass;
  glass.base_color = {0.2F, 0.8F, 0.4F};
  glass.transmission = 1.0F;
  place(scene, triangle, glm::translate(glm::dmat4(1.0), glm::dvec3(0.0, 1.0, 0.0)), glass);
  const auto patches = build(scene, 256);
  const auto pane = std::ranges::find_if(patches.surfaces, [](const Surface& s) { return s.first_tint != kNone; });
  ASSERT_NE(pane, patches.surfaces.end());
  EXPECT_LT(pane->first_tint_cell, pane->first_opacity);
  EXPECT_EQ(patches.tints.size(), std::size_t{pane->width} * pane->height * pane->opacity_scale * pane->opacity_scale);
  for (const auto& tint : patches.leaf_tints) EXPECT_LT(glm::distance(tint, glm::vec3(0.25F, 1.0F, 0.5F)), 1e-3F);
}

TEST(Opacity, TransmissionHasItsTextureAtThePlace) {
  const auto patches = build(pane(glm::vec3(1.0F), {{{255, 0, 0}}, {{0, 255, 255}}}, true), 256);
  const auto& surface = patches.surfaces[0];
  const auto width = static_cast<float>(surface.width), height = static_cast<float>(surface.height);
  EXPECT_NEAR(patches.opacityAt(surface, {0.25F * width, 0.5F * height}), 255.0 * 0.04, 1.0);
  EXPECT_EQ(patches.opacityAt(surface, {0.75F * width, 0.5F * height}), 255);
  EXPECT_TRUE(patches.tints.empty()) << "a mask has no colour";
}

TEST(Opacity, AFineTextureGetsAFineGrid) {
  std::vector<std::uint8_t> stripes;
  for (int i = 0; i < 64; ++i) stripes.push_back(i % 4 < 2 ? 255 : 0);
  const auto patches = build(veiledFloor(AlphaMode::kMask, 64, 1, stripes), 16);
  EXPECT_GE(patches.surfaces[0].opacity_scale, 8U);
  EXPECT_NEAR(leafArea(patches), 0.5, 0.03);
}

TEST(Opacity, AGlassBoxBuriesNothing) {
  Scene scene;
  place(scene, floorQuad(1.0, 0.0, 0.0), glm::dmat4(1.0), Material{});
  Material glass;
  glass.transmission = 0.9F;
  place(scene, box({0.25, 0.0, 0.25}, {0.75, 0.5, 0.75}), glm::dmat4(1.0), glass);
  const auto patches = build(scene, 400);
  double floor_area = 0.0;
  for (const auto& s : patches.surfaces) {
    if (s.see_through) continue;
    floor_area += static_cast<double>(
        patches.node_area[s.first_node[0] + levelGrid(s.width, s.height, s.level_count - 1).offset]);
  }
  EXPECT_NEAR(floor_area * patches.scale * patches.scale, 1.0, 1e-4);
  // Nor is it a closed solid, whose backs would not be drawn: light crosses two panes of it.
  EXPECT_EQ(std::ranges::count(patches.solids.solid_of, kNone), static_cast<std::ptrdiff_t>(patches.triangles.size()));
}

}  // namespace
}  // namespace radiosity::scene::test
