#include "server/solver/paper/patch_trees.h"

#include <gtest/gtest.h>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::makeQuadScene;

test::Quad unitQuad(std::uint32_t width, std::uint32_t height) {
  return {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, width, height, glm::vec3(1.0F), glm::vec3(0.5F)};
}

FluxAccumulators nothing(const PatchTrees& trees) {
  FluxAccumulators flux;
  flux.reset(trees.patches().nodeCount());
  return flux;
}

std::int64_t quanta(const PatchTrees& trees, double flux) { return std::llround(flux * trees.fluxScale()); }

TEST(PatchTrees, UnshotPowerIsTheEmissionAtFirst) {
  const auto made = makeQuadScene({unitQuad(9, 4)});
  PatchTrees trees(made.patches, made.materials, 0.0);
  EXPECT_NEAR(trees.totalPower(), 3.0, 1e-5);  // emission 1 in three channels over unit area
  const auto taken = trees.takeUnshot({0, 1, 0, 0});
  EXPECT_NEAR(taken.x, 4.0 / 36.0, 1e-6);
  EXPECT_NEAR(trees.totalPower(), 3.0 * 32.0 / 36.0, 1e-5);
  EXPECT_EQ(trees.unshot(0).x, 0.0);
  EXPECT_GT(trees.unshot(2).x, 0.0);
}

// Light on the root is light all over; the polygon's power is known before anything is pushed.
TEST(PatchTrees, PushHandsLightOfANodeToItsLeavesAndPullBringsPowerUp) {
  const auto made = makeQuadScene({unitQuad(8, 8)});
  PatchTrees trees(made.patches, made.materials, 0.0);
  const auto& side = trees.sides()[0];
  (void)trees.takeUnshot({0, side.level_count - 1, 0, 0});
  auto shot = nothing(trees);
  shot.node[0][side.first_node + side.node_count - 1] = {quanta(trees, 0.25), 0, 0};
  trees.receive(shot);
  EXPECT_NEAR(trees.totalPower(), 0.25 * static_cast<double>(side.mean_reflectance), 1e-6);
  EXPECT_EQ(trees.irradiance(side.first_node).x, 0.0) << "nothing is pushed before it has to be";
  trees.pushPull(0);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    EXPECT_NEAR(trees.irradiance(side.first_node + leaf).x, 0.25, 1e-6);
    EXPECT_NEAR(trees.unshot(side.first_node + leaf).x, 0.25 * static_cast<double>(trees.reflectance(side, leaf).x),
                1e-6);
  }
  EXPECT_NEAR(trees.power(side.first_node + side.node_count - 1), trees.totalPower(), 1e-12);
}

TEST(PatchTrees, FluxOnANodeWithoutAreaGoesToItsParent) {
  const auto made = makeQuadScene({unitQuad(4, 4)});
  made.patches->node_area[5] = 0.0F;
  PatchTrees trees(made.patches, made.materials, 0.0);
  auto shot = nothing(trees);
  shot.node[0][5] = {quanta(trees, 0.01), 0, 0};
  trees.receive(shot);
  trees.pushPullAll();
  EXPECT_EQ(trees.irradiance(5).x, 0.0);
  EXPECT_GT(trees.irradiance(0).x, 0.0);  // same parent
}

TEST(PatchTrees, TheGaussianKeepsFluxAndSpreadsIt) {
  const auto made = makeQuadScene({unitQuad(6, 5)});
  PatchTrees trees(made.patches, made.materials, 0.0);
  auto shot = nothing(trees);
  shot.node[1][2 * 6 + 3] = {quanta(trees, 0.3), 0, 0};
  trees.receive(shot);
  trees.pushPullAll();
  const double area = 1.0 / 30.0;
  double sum = 0.0;
  for (std::uint32_t leaf = 0; leaf < 30; ++leaf) sum += area * trees.irradiance(leaf).x;
  EXPECT_NEAR(sum, 0.3, 1e-6);
  EXPECT_NEAR(area * trees.irradiance(2 * 6 + 3).x, 0.3 / 4.0, 1e-6);
  EXPECT_NEAR(area * trees.irradiance(1 * 6 + 3).x, 0.3 / 8.0, 1e-6);
  EXPECT_NEAR(area * trees.irradiance(1 * 6 + 2).x, 0.3 / 16.0, 1e-6);
}

TEST(PatchTrees, EvenLightStaysEvenUnderTheGaussian) {
  const auto made = makeQuadScene({unitQuad(7, 3)});
  made.patches->node_area[4] *= 0.3F;
  PatchTrees trees(made.patches, made.materials, 0.0);
  auto shot = nothing(trees);
  const auto& side = trees.sides()[0];
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
    shot.node[0][leaf] = {quanta(trees, static_cast<double>(made.patches->node_area[leaf])), 0, 0};
  trees.receive(shot);
  trees.pushPullAll();
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) EXPECT_NEAR(trees.irradiance(leaf).x, 1.0, 1e-6) << leaf;
}

}  // namespace
}  // namespace radiosity::solver
