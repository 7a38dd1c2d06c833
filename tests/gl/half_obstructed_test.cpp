// Two unit squares one metre apart and a quarter of a square half-way between them: F = 0.149870, of which View3D and
// adaptive integration agree. Through the hemicube and through the gathered light. And what of a near node is seen.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

#include "server/gpu/workers/gpu_transport.h"
#include "server/solver/math/polygon_form_factor.h"
#include "server/solver/transport/node_shots.h"
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

// A leaf hangs over a floor that shoots as one node, right beside a wall that hides the floor behind itself: a fifth of
// its area, but near to a third of its form factor. Single points of the floor find the former, 0.82 for 0.69; what is
// left of that in the ratio of sums over four of them, and of the first samples, is a thirtieth.
TEST_F(HalfObstructedSquares, WhatIsSeenOfANearNodeIsWeighedByItsFormFactor) {
  SceneBuilder builder;
  builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 8, 8});
  const auto leaf = builder.add({{0.29F, -0.01F, -0.1F}, {0, 0.02F, 0}, {0.02F, 0, 0}, 1, 1});
  builder.add({{0.32F, -0.5F, -0.5F}, {0, 1, 0}, {0, 0, 0.4F}, 1, 1, true});
  scene_ = builder.build();
  ASSERT_TRUE(transport_->setScene(scene_).has_value());
  const auto sides = solver::makeSides(*scene_);
  const solver::NodePlace floor{0, 3, 0, 0};
  double sum = 0.0, points = 0.0;
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    const solver::NodeShots shots(*scene_, sides, seed);
    solver::ShotBatch batch;
    for (std::uint32_t index = 0; index < 16; ++index) {
      shots.add(floor, index % 2, index / 2, 64, batch);
      EXPECT_EQ(batch.gather.back().point_count, shots.pointsOf(floor, index / 2));
    }
    const auto done = transport_->measure(batch, [&](std::size_t i, solver::LinkSample&& links) {
      points += batch.gather[i].point_count;
      std::size_t value = 0;
      for (const auto& run : links.runs) {
        for (std::uint32_t k = 0; k < run.count; ++k, ++value) {
          if (run.first_node + k == scene_->surfaces[leaf].first_node[0])
            sum += batch.gather[i].point_count * static_cast<double>(links.irradiance[value]);
        }
      }
    });
    ASSERT_TRUE(done.has_value()) << done.error().text();
  }
  const std::array<glm::vec3, 4> seen{{{-0.5, -0.5, -0.5}, {0.32, -0.5, -0.5}, {0.32, 0.5, -0.5}, {-0.5, 0.5, -0.5}}};
  const double exact = solver::polygonFormFactor({0.3, 0.0, -0.1}, {0, 0, -1}, seen);
  EXPECT_NEAR(sum / points / exact, 1.0, 0.05);
}

TEST(NodeShots, SamplesGoOnInTheSequenceOfPoints) {
  SceneBuilder builder;
  builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 8, 8});
  const auto scene = builder.build();
  const auto sides = solver::makeSides(*scene);
  const solver::NodeShots shots(*scene, sides, 5);
  solver::ShotBatch batch;
  std::vector<std::uint32_t> counts;
  for (std::uint32_t index = 0; index < 6; ++index) {
    shots.add({0, 3, 0, 0}, 0, index, 64, batch);
    counts.push_back(batch.gather.back().point_count);
  }
  EXPECT_EQ(counts, (std::vector<std::uint32_t>{1, 1, 2, 4, 4, 4}));
  // Each 16 points in a row of the sequence have one in each cell of 4 x 4.
  std::array<int, 16> cells{};
  for (std::size_t i = 0; i < 16; ++i) {
    const auto& at = batch.points[i].origin;
    const auto cell = [](float x) { return static_cast<std::size_t>((x + 0.5F) * 4.0F); };
    ++cells[4 * cell(at.y) + cell(at.x)];
  }
  EXPECT_THAT(cells, ::testing::Each(1));
}

}  // namespace
}  // namespace radiosity::test
