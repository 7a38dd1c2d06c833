#include "server/solver/shooting/state.h"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::makeQuadScene;
using test::Quad;

Quad unitQuad(std::uint32_t width, std::uint32_t height) {
  Quad quad{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, width, height};
  quad.reflectance = glm::vec3(0.5F);
  quad.emission = glm::vec3(1.0F);
  return quad;
}

TEST(PushPull, FluxOfACoarseNodeReachesItsLeavesOnly) {
  const auto made = makeQuadScene({unitQuad(5, 3)});
  RadiosityState state(made.patches, made.materials);
  auto& side = state.sides()[0];
  FluxAccumulators batch;
  batch.reset(made.patches->nodeCount());
  const auto level1 = scene::levelGrid(5, 3, 1);
  ASSERT_EQ(level1.width, 3U);
  const auto node = side.first_node + level1.offset + 1 * level1.width + 2;  // covers leaf (4, 2) alone
  batch.node[0][node] = {1 << 20, 1 << 20, 1 << 20};
  state.receive(batch);
  state.pushPull(side);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    if (leaf == 2 * 5 + 4) {
      EXPECT_GT(state.irradiance(side, leaf).x, 0.0F);
    } else {
      EXPECT_EQ(state.irradiance(side, leaf).x, 0.0F) << leaf;
    }
  }
}

TEST(PushPull, ReceivedFluxEqualsIrradianceTimesAreaAtAnyMixOfLevels) {
  const auto made = makeQuadScene({unitQuad(7, 6)});
  RadiosityState state(made.patches, made.materials);
  auto& side = state.sides()[0];
  FluxAccumulators batch;
  batch.reset(made.patches->nodeCount());
  std::int64_t sum = 0;
  for (std::uint32_t node = 0; node < side.node_count; ++node) {
    batch.node[node % 2][node] = {std::int64_t{1000} * (node + 1), 0, 0};
    sum += std::int64_t{1000} * (node + 1);
  }
  state.receive(batch);
  state.pushPull(side);
  double flux = 0.0;
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
    flux += static_cast<double>(state.irradiance(side, leaf).x * state.leafArea(side, leaf));
  EXPECT_NEAR(flux * state.fluxScale() / static_cast<double>(sum), 1.0, 1e-5);
}

TEST(PushPull, PowerOfANodeIsTheSumOfItsChildren) {
  const auto made = makeQuadScene({unitQuad(9, 4)});
  RadiosityState state(made.patches, made.materials);
  auto& side = state.sides()[0];
  state.pushPull(side);
  EXPECT_NEAR(side.unshot_power, 3.0, 1e-5);  // emission 1 in three channels over unit area
  const auto shot = state.markShot(side, 1, 0, 0);
  EXPECT_NEAR(shot.x, 4.0 / 36.0, 1e-6);
  EXPECT_NEAR(side.unshot_power, 3.0 * 32.0 / 36.0, 1e-5);
  EXPECT_EQ(state.unshot(side, 0).x, 0.0F);
  EXPECT_GT(state.unshot(side, 2).x, 0.0F);
}

TEST(Receive, FluxOnANodeWithoutAreaGoesToItsParent) {
  const auto made = makeQuadScene({unitQuad(4, 4)});
  made.patches->node_area[5] = 0.0F;
  RadiosityState state(made.patches, made.materials);
  auto& side = state.sides()[0];
  FluxAccumulators batch;
  batch.reset(made.patches->nodeCount());
  batch.node[0][5] = {1 << 20, 0, 0};
  state.receive(batch);
  state.pushPull(side);
  EXPECT_EQ(state.irradiance(side, 5).x, 0.0F);
  EXPECT_GT(state.irradiance(side, 0).x, 0.0F);  // same parent
  EXPECT_EQ(state.irradiance(side, 2).x, 0.0F);
}

TEST(Rounds, AnotherRoundMakesTheWholeRadiosityUnshotAgain) {
  const auto made = makeQuadScene({unitQuad(4, 4)});
  RadiosityState state(made.patches, made.materials);
  auto& side = state.sides()[0];
  state.pushPull(side);
  (void)state.markShot(side, side.level_count - 1, 0, 0);
  EXPECT_EQ(side.unshot_power, 0.0);
  state.startRound();
  state.pushPullAll();
  EXPECT_NEAR(side.unshot_power, 3.0, 1e-5);
}

}  // namespace
}  // namespace radiosity::solver
