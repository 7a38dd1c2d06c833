// Form factors through real hemicubes against exact values (Howell's catalogue; Schroeder and Hanrahan 1993).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/gpu/workers/gpu_transport.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

class Scatter : public ::testing::Test {
 protected:
  void SetUp() override {
    auto made = gpu::makeInProcessTransport();
    if (!made) GTEST_SKIP() << made.error().text();
    transport_ = std::move(*made);
  }

  solver::FluxAccumulators run(const std::shared_ptr<const scene::PatchScene>& scene,
                               std::vector<solver::ScatterShot> shots) {
    EXPECT_TRUE(transport_->setScene(scene).has_value());
    solver::ShotBatch batch;
    batch.flux_scale = kFluxScale;
    batch.scatter = std::move(shots);
    auto flux = accumulators(*scene);
    const auto counters = transport_->run(batch, flux);
    EXPECT_TRUE(counters.has_value()) << counters.error().text();
    return flux;
  }

  /// Mean form factor from surface 0 to surface 1 over a stratified grid of points on surface 0.
  double formFactor(const SceneBuilder& builder, std::uint32_t points_a_side, std::uint32_t resolution) {
    const auto scene = builder.build();
    std::mt19937 random(7);
    std::uniform_real_distribution<float> unit(0.0F, 1.0F);
    std::vector<solver::ScatterShot> shots;
    for (std::uint32_t i = 0; i < points_a_side; ++i) {
      for (std::uint32_t j = 0; j < points_a_side; ++j) {
        const auto size = static_cast<float>(points_a_side);
        shots.push_back(shotFrom(*scene, 0, (static_cast<float>(i) + unit(random)) / size,
                                 (static_cast<float>(j) + unit(random)) / size, resolution, random));
      }
    }
    const auto count = static_cast<double>(shots.size());
    return fluxAt(*scene, run(scene, std::move(shots)), 1, kFluxScale) / count;
  }

  std::unique_ptr<solver::Transport> transport_;
};

SceneBuilder parallelSquares(float side, float distance) {
  SceneBuilder builder;
  builder.add({{-side / 2, -side / 2, -distance / 2}, {side, 0, 0}, {0, side, 0}, 8, 8});
  builder.add({{-side / 2, -side / 2, distance / 2}, {0, side, 0}, {side, 0, 0}, 8, 8});
  return builder;
}

TEST_F(Scatter, ParallelUnitSquares) { EXPECT_NEAR(formFactor(parallelSquares(1, 1), 16, 256), 0.1998248957, 0.0005); }

TEST_F(Scatter, ParallelUnitSquaresFromTheCentre) {
  const auto scene = parallelSquares(1, 1).build();
  std::mt19937 random(3);
  std::vector<solver::ScatterShot> shots;
  for (int i = 0; i < 64; ++i) shots.push_back(shotFrom(*scene, 0, 0.5F, 0.5F, 256, random));
  EXPECT_NEAR(fluxAt(*scene, run(scene, shots), 1, kFluxScale) / 64, 0.239456, 0.00024);
}

TEST_F(Scatter, SmallParallelSquares) {
  EXPECT_NEAR(formFactor(parallelSquares(0.1F, 1), 16, 256), 0.0031620568, 0.0031620568 * 0.005);
}

TEST_F(Scatter, PerpendicularUnitSquaresWithACommonEdge) {
  SceneBuilder builder;
  builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 8, 8});
  builder.add({{-0.5F, -0.5F, -0.5F}, {0, 1, 0}, {0, 0, 1}, 8, 8});
  EXPECT_NEAR(formFactor(builder, 24, 256), 0.2000437761, 0.001);
}

TEST_F(Scatter, NothingBehindTheShooterReceivesAnything) {
  SceneBuilder builder;
  builder.add({{-0.5F, -0.5F, 0.0F}, {1, 0, 0}, {0, 1, 0}, 8, 8});
  builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 8, 8});
  builder.add({{-0.5F, 0.5F, 0.0F}, {1, 0, 0}, {0, 0.4F, 0}, 8, 8});  // in the same plane
  const auto scene = builder.build();
  std::mt19937 random(5);
  const auto flux = run(scene, {shotFrom(*scene, 0, 0.31F, 0.77F, 64, random)});
  EXPECT_EQ(flux.escaped[0], static_cast<std::int64_t>(kFluxScale));
  EXPECT_EQ(flux.scattered[0], 0);
}

TEST_F(Scatter, TheBackOfASingleSidedSurfaceAbsorbs) {
  SceneBuilder builder;
  builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 8, 8});
  builder.add({{-0.5F, -0.5F, 0.5F}, {1, 0, 0}, {0, 1, 0}, 8, 8});
  const auto scene = builder.build();
  std::mt19937 random(5);
  const auto flux = run(scene, {shotFrom(*scene, 0, 0.5F, 0.5F, 128, random)});
  EXPECT_NEAR(static_cast<double>(flux.backface[0]) / kFluxScale, 0.239456, 0.003);
  EXPECT_EQ(flux.backface[0] + flux.escaped[0], static_cast<std::int64_t>(kFluxScale));
}

TEST_F(Scatter, ADoubleSidedSurfaceReceivesOnTheSideSeen) {
  SceneBuilder builder;
  builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 8, 8});
  builder.add({{-0.5F, -0.5F, 0.5F}, {1, 0, 0}, {0, 1, 0}, 8, 8, true});
  const auto scene = builder.build();
  std::mt19937 random(5);
  const auto flux = run(scene, {shotFrom(*scene, 0, 0.5F, 0.5F, 128, random)});
  EXPECT_EQ(fluxAt(*scene, flux, 1, kFluxScale, 0), 0.0);
  EXPECT_NEAR(fluxAt(*scene, flux, 1, kFluxScale, 1), 0.239456, 0.003);
}

TEST_F(Scatter, NothingEscapesFromAClosedBox) {
  SceneBuilder builder;
  builder.addBox(glm::vec3(-0.5F), glm::vec3(0.5F), 16, true);
  const auto scene = builder.build();
  std::mt19937 random(11);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  std::vector<solver::ScatterShot> shots;
  const auto place = [&](int i) {  // some anywhere, some beside an edge, some in a corner
    if (i % 3 == 0) return unit(random);
    const float near = std::pow(10.0F, -1.0F - 4.0F * unit(random));
    return unit(random) < 0.5F ? near : 1.0F - near;
  };
  for (int i = 0; i < 600; ++i) {
    const float u = place(i);
    shots.push_back(
        shotFrom(*scene, static_cast<std::uint32_t>(i % 6), u, place(i + i % 2), i % 5 == 0 ? 256 : 64, random));
    shots.back().flux = {1.0, 1.0, 1.0};
  }
  const auto flux = run(scene, shots);
  EXPECT_EQ(flux.escaped[0], 0);
  EXPECT_EQ(flux.backface[0], 0);
  // 2^40 is a multiple of 2^30, so every weight delivers an exact integer: nothing is lost to rounding.
  EXPECT_EQ(flux.scattered[0], 600 * static_cast<std::int64_t>(kFluxScale));
}

TEST_F(Scatter, OppositeShotsCancelToExactlyNothing) {
  const auto scene = randomRoom(60, 2000, 1);
  std::mt19937 random(13);
  std::vector<solver::ScatterShot> shots;
  for (std::uint32_t i = 0; i < 40; ++i) {
    shots.push_back(shotFrom(*scene, i % 6, 0.37F, 0.61F, i % 2 == 0 ? 64 : 32, random));
    shots.back().flux = {0.1234567 * i, 3.3e-5, 1.0 / 3.0};
  }
  const auto count = shots.size();
  for (std::size_t i = 0; i < count; ++i) {
    auto undo = shots[(i * 7) % count];
    for (auto& channel : undo.flux) channel = -channel;
    shots.push_back(undo);
  }
  const auto flux = run(scene, shots);
  for (const auto& node : flux.node[0]) ASSERT_EQ(node, solver::Flux3{});
  EXPECT_EQ(flux.scattered, solver::Flux3{});
  EXPECT_EQ(flux.escaped, solver::Flux3{});
}

TEST_F(Scatter, AShotDeliversTheSameBitsWhateverIsInItsBatch) {
  const auto scene = randomRoom(402, 13742, 2);
  std::mt19937 random(17);
  std::vector<solver::ScatterShot> shots;
  for (std::uint32_t i = 0; i < 60; ++i) shots.push_back(shotFrom(*scene, i % 30, 0.41F, 0.3F, 64, random));
  const auto together = run(scene, shots);
  auto apart = accumulators(*scene);
  std::shuffle(shots.begin(), shots.end(), random);
  for (const auto& shot : shots) {
    solver::ShotBatch batch;
    batch.flux_scale = kFluxScale;
    batch.scatter = {shot};
    ASSERT_TRUE(transport_->run(batch, apart).has_value());
  }
  EXPECT_EQ(together.node, apart.node);
  EXPECT_EQ(together.backface, apart.backface);
}

TEST_F(Scatter, AShotOutsideTheContractIsRefusedAndChangesNothing) {
  const auto scene = parallelSquares(1, 1).build();
  ASSERT_TRUE(transport_->setScene(scene).has_value());
  std::mt19937 random(1);
  solver::ShotBatch batch;
  batch.scatter = {shotFrom(*scene, 0, 0.5F, 0.5F, 64, random), shotFrom(*scene, 0, 0.5F, 0.5F, 63, random)};
  auto flux = accumulators(*scene);
  EXPECT_FALSE(transport_->run(batch, flux).has_value());
  EXPECT_EQ(flux.scattered, solver::Flux3{});
}

}  // namespace
}  // namespace radiosity::test
