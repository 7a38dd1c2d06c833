// What mirrors show in pictures.
#include "server/engine/publish/mirror_view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "server/solver/patches/side.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::engine {
namespace {

constexpr float kReflects = 0.9F, kGlows = 70.0F;

/// A mirror half a metre before the camera, and a wall as far behind it that is brighter from leaf to leaf, and glows.
MirrorScene makeScene() {
  test::Quad mirror{{-0.5F, -0.5F, -0.5F}, {1.0F, 0.0F, 0.0F}, {0.0F, 1.0F, 0.0F}};
  test::Quad wall{{0.5F, -0.5F, 0.5F}, {-1.0F, 0.0F, 0.0F}, {0.0F, 1.0F, 0.0F}};
  wall.reflectance = glm::vec3(0.5F);
  wall.emission = glm::vec3(kGlows);
  auto made = test::makeQuadScene({mirror, wall});
  const auto sides = solver::makeSides(*made.patches);
  made.materials.specular = made.materials.lobe = scene::SideColours(*made.patches);
  made.materials.specular.fill(sides[0].number, glm::vec3(kReflects));
  made.materials.lobe.fill(sides[0].number, glm::vec3(0.0F, kReflects, 0.0F));
  MirrorScene scene{made.patches, made.materials, {}, {}};
  scene.irradiance.resize(made.patches->nodeCount());
  for (std::uint32_t leaf = 0; leaf < sides[1].leaf_count; ++leaf)
    scene.irradiance[sides[1].first_node + leaf] = glm::vec3(100.0F * (static_cast<float>(leaf % 8) + 0.5F));
  return scene;
}

TEST(MirrorView, ShowsWhatGlowsAndReflectsAsALookupInItsTexelsHasIt) {
  const auto scene = makeScene();
  scene::Camera camera;
  camera.yfov_rad = 0.5;
  constexpr int kSize = 64;
  gpu::ViewPicture picture{Image(kSize, kSize), std::vector<float>(std::size_t{kSize} * kSize, 1.0F)};
  addMirrors(picture, camera, scene);
  const double half = std::tan(0.25), scale = scene.patches->scale;
  ASSERT_EQ(scale, 1.0);
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const double across = (2.0 * (x + 0.5) / kSize - 1.0) * half * 1.5;  // on the wall, a metre behind the mirror
      const double texel = 8.0 * (0.5 - across);
      ASSERT_GT(texel, 0.5);
      ASSERT_LT(texel, 7.5);
      const double truth =
          static_cast<double>(kReflects) * (static_cast<double>(kGlows) + 0.5 * 100.0 * texel) / std::numbers::pi;
      ASSERT_NEAR(picture.image.pixels[picture.image.index(x, y)].g, truth, 1e-3 * truth) << x << ", " << y;
    }
  }
}

TEST(MirrorView, AddsNothingWhereNothingIsDrawn) {
  gpu::ViewPicture picture{Image(4, 4), std::vector<float>(16, 0.0F)};
  addMirrors(picture, {}, makeScene());
  for (const auto& pixel : picture.image.pixels) EXPECT_EQ(pixel, glm::vec3(0.0F));
}

}  // namespace
}  // namespace radiosity::engine
