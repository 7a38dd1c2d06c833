// What mirrors show in pictures.
#include "server/engine/publish/mirror_view.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/solver/math/microfacets.h"
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

// A lamp a tenth of a metre wide, against what one bounce brings of it, by a grid over it: several bounces bring some
// hundredths more. By chance alone a pixel, 32 directions of which few meet the lamp, were off by half of its light.
TEST(MirrorView, ShowsASmallLampInBrushedMetalWithoutGrain) {
  constexpr double kRoughness = 0.4, kSide = 0.1;
  test::Quad mirror{{-0.5F, -0.5F, -0.5F}, {1.0F, 0.0F, 0.0F}, {0.0F, 1.0F, 0.0F}};
  test::Quad lamp{{0.05F, 0.15F, 0.2F}, {-0.1F, 0.0F, 0.0F}, {0.0F, 0.1F, 0.0F}, 2, 2};
  lamp.emission = glm::vec3(kGlows);
  auto made = test::makeQuadScene({mirror, lamp});
  const auto sides = solver::makeSides(*made.patches);
  made.materials.specular = made.materials.lobe = scene::SideColours(*made.patches);
  made.materials.specular.fill(sides[0].number, glm::vec3(kReflects));
  made.materials.lobe.fill(sides[0].number, glm::vec3(static_cast<float>(kRoughness), kReflects, 0.0F));
  MirrorScene scene{made.patches, made.materials, std::vector<glm::vec3>(made.patches->nodeCount()), {}};
  scene::Camera camera;
  camera.yfov_rad = 0.5;
  constexpr int kSize = 32;
  gpu::ViewPicture picture{Image(kSize, kSize), std::vector<float>(std::size_t{kSize} * kSize, 1.0F)};
  addMirrors(picture, camera, scene);
  double sum = 0.0, truth = 0.0, grain = 0.0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const auto in_view = [&](int i) { return (2.0 * (i + 0.5) / kSize - 1.0) * std::tan(0.25); };
      const glm::dvec3 on(0.5 * in_view(x), -0.5 * in_view(y), -0.5);
      double pixel = 0.0;
      constexpr int kGrid = 8;
      for (int i = 0; i < kGrid * kGrid; ++i) {
        const glm::dvec3 point(-0.05 + kSide * (i % kGrid + 0.5) / kGrid, 0.15 + kSide * (i / kGrid + 0.5) / kGrid,
                               0.2);
        const auto way = point - on;
        const double square = glm::dot(way, way), angle = kSide * kSide * way.z / (square * std::sqrt(square));
        pixel += solver::bounceOnce({0, 0, 1}, glm::normalize(on), glm::normalize(way), kRoughness).density * angle *
                 static_cast<double>(kReflects * kGlows) / std::numbers::pi / (kGrid * kGrid);
      }
      const auto found = static_cast<double>(picture.image.pixels[picture.image.index(x, y)].g);
      sum += found;
      truth += pixel;
      grain += (found - pixel) * (found - pixel);
    }
  }
  EXPECT_GT(sum, truth);
  EXPECT_NEAR(sum, truth, 0.06 * truth);
  EXPECT_LT(std::sqrt(grain) * kSize, 0.15 * sum);  // of the mean
}

TEST(MirrorView, AddsNothingWhereNothingIsDrawn) {
  gpu::ViewPicture picture{Image(4, 4), std::vector<float>(16, 0.0F)};
  addMirrors(picture, {}, makeScene());
  for (const auto& pixel : picture.image.pixels) EXPECT_EQ(pixel, glm::vec3(0.0F));
}

}  // namespace
}  // namespace radiosity::engine
