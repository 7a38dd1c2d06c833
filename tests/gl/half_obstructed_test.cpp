// Two unit squares one metre apart and a quarter of a square half-way between them: F = 0.149870, of which View3D and
// adaptive integration agree. Through the hemicube and through the gathered light.
#include <gtest/gtest.h>

#include <cmath>

#include "server/gpu/gpu_transport.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

constexpr double kObstructed = 0.149870, kOpen = 0.1998248957;

class HalfObstructedSquares : public ::testing::Test {
 protected:
  void SetUp() override {
    auto made = gpu::makeInProcessTransport();
    if (!made) GTEST_SKIP() << made.error().text();
    transport_ = std::move(*made);
  }

  void build(bool obstructed) {
    SceneBuilder builder;
    builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 32, 32});
    builder.add({{-0.5F, -0.5F, 0.5F}, {0, 1, 0}, {1, 0, 0}, 32, 32});
    if (obstructed) builder.add({{-0.5F, -0.5F, 0.0F}, {0.5F, 0, 0}, {0, 0.5F, 0}, 1, 1, true});
    scene_ = builder.build();
    ASSERT_TRUE(transport_->setScene(scene_).has_value());
  }

  /// Light that reaches the other square, of 1 that leaves the first.
  double factor(const solver::ShotBatch& batch, double emitted) {
    auto flux = accumulators(*scene_);
    const auto done = transport_->run(batch, flux);
    EXPECT_TRUE(done.has_value()) << done.error().text();
    return fluxAt(*scene_, flux, 1, kFluxScale) / emitted;
  }

  /// kSide x kSide hemicubes, one at a random point of each cell of the lower square.
  solver::ShotBatch scattered() {
    std::mt19937 random(7);
    std::uniform_real_distribution<float> unit(0.0F, 1.0F);
    solver::ShotBatch batch;
    batch.flux_scale = kFluxScale;
    for (std::uint32_t i = 0; i < kSide * kSide; ++i) {
      const float u = (static_cast<float>(i % kSide) + unit(random)) / kSide;
      const float v = (static_cast<float>(i / kSide) + unit(random)) / kSide;
      batch.scatter.push_back(shotFrom(*scene_, 0, u, v, 128, random));
    }
    return batch;
  }

  /// The same points as those of one light.
  solver::ShotBatch gathered() {
    auto batch = scattered();
    solver::GatherShot shot;
    const auto first = scene_->indices[3 * static_cast<std::size_t>(scene_->surfaces[0].first_triangle)];
    shot.corner_count = 4;
    for (std::uint32_t i = 0; i < 4; ++i) shot.corners[i] = scene_->vertices[first + i].position;
    shot.normal = scene_->triangles[scene_->surfaces[0].first_triangle].normal;
    shot.radiosity = {1.0, 0.0, 0.0};
    shot.point_count = kSide * kSide;
    for (const auto& s : batch.scatter) batch.points.push_back(s.frame);
    batch.scatter.clear();
    batch.gather = {shot};
    return batch;
  }

  static constexpr std::uint32_t kSide = 16;
  std::unique_ptr<solver::Transport> transport_;
  std::shared_ptr<const scene::PatchScene> scene_;
};

// One random point in each of n x n cells integrates a function with an edge in it to about 1 / n^1.5 of its spread:
// here 1 / 64 of a third, 0.5 % of F. Four times that.
constexpr double kTolerance = 0.02;

TEST_F(HalfObstructedSquares, TheHemicubeFindsTheFormFactor) {
  build(false);
  EXPECT_NEAR(factor(scattered(), kSide * kSide) / kOpen, 1.0, kTolerance);
  build(true);
  EXPECT_NEAR(factor(scattered(), kSide * kSide) / kObstructed, 1.0, kTolerance);
}

TEST_F(HalfObstructedSquares, GatheredLightHasTheFormFactor) {
  build(false);
  EXPECT_NEAR(factor(gathered(), 1.0) / kOpen, 1.0, 1e-3);  // Lambert's formula at 1024 texels: no sampling at all
  build(true);
  EXPECT_NEAR(factor(gathered(), 1.0) / kObstructed, 1.0, kTolerance);
}

}  // namespace
}  // namespace radiosity::test
