// What rays see where pixels cannot.
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "server/gpu/workers/gpu_transport.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/math/sampling.h"
#include "tests/gl/gather_fixture.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

/// What a round of all lights brings.
solver::FluxAccumulators deliver(solver::Transport& transport, const scene::PatchScene& scene,
                                 solver::PunctualLights& lights) {
  auto flux = accumulators(scene);
  while (lights.hasSlice(1)) {
    solver::ShotBatch slice;
    lights.addSlice(1, slice);
    slice.flux_scale = kFluxScale;
    EXPECT_TRUE(transport.run(slice, flux));
  }
  return flux;
}

// A closed house of walls of no thickness, a thousandth as wide as the ground around it: by images, whose pixels are
// wider than its roof, the sun lights it within.
TEST(ShadowRays, NoLightGetsIntoAClosedHouseOnWideGround) {
  auto made = gpu::makeInProcessTransport(0, std::nullopt, gpu::Sight::kRays);
  if (!made) GTEST_SKIP() << made.error().text();
  SceneBuilder builder;
  const auto ground = builder.add({{-0.5F, 0.0F, -0.5F}, {0, 0, 1}, {1, 0, 0}, 64, 64});
  const glm::vec3 low(0.1001F, 0.0F, 0.2003F), high = low + glm::vec3(0.001F, 0.0005F, 0.001F);
  const auto inside = builder.addBox(low, high, 4, true);
  (void)builder.addBox(low, high, 4, false);
  const auto scene = builder.build();
  ASSERT_TRUE((*made)->setScene(scene));
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const float turn = 0.05F * static_cast<float>(seed);
    solver::LightSources sources;
    sources.lights = {
        {.kind = scene::LightKind::kDirectional, .direction = {0.3F + turn, -0.8F, 0.2F}, .intensity = glm::vec3(1e5F)},
        {.kind = scene::LightKind::kPoint,
         .position = {0.1F, 0.3F + 0.1F * turn, 0.2F},
         .intensity = glm::vec3(100.0F)}};
    sources.sky = {glm::vec3(1000.0F), glm::vec3(0.0F)};
    solver::PunctualLights lights(*scene, sources, {.seed = seed});
    const auto flux = deliver(**made, *scene, lights);
    EXPECT_GT(fluxAt(*scene, flux, ground, kFluxScale), 0.0);
    for (std::uint32_t face = 0; face < 6; ++face)
      EXPECT_EQ(fluxAt(*scene, flux, inside + face, kFluxScale), 0.0) << "face " << face << ", seed " << seed;
  }
}

// A box stands on a floor, which has no leaves within it: what shines there ends on the backs of five faces, and on
// that part of the floor, whose front faces it.
TEST(ShadowRays, WhatShinesWithinASolidIsAbsorbedThere) {
  auto made = gpu::makeInProcessTransport(0, std::nullopt, gpu::Sight::kRays);
  if (!made) GTEST_SKIP() << made.error().text();
  SceneBuilder builder;
  (void)builder.add({{-0.5F, 0.0F, -0.5F}, {0, 0, 1}, {1, 0, 0}, 20, 20});
  (void)builder.addBox({-0.2F, 0.0F, -0.2F}, {0.2F, 0.3F, 0.2F}, 4, false);
  auto scene = std::make_shared<scene::PatchScene>(*builder.build());
  for (std::uint32_t y = 6; y < 14; ++y)
    for (std::uint32_t x = 6; x < 14; ++x) scene->node_area[20 * y + x] = 0.0F;
  ASSERT_TRUE((*made)->setScene(scene));
  solver::LightSources sources;
  sources.lights = {{.kind = scene::LightKind::kPoint, .position = {0.0F, 0.1F, 0.0F}, .intensity = glm::vec3(1.0F)}};
  solver::PunctualLights lights(*scene, sources, {.seed = 1});
  const auto flux = deliver(**made, *scene, lights);
  EXPECT_EQ(flux.escaped[0], 0);
  EXPECT_NEAR(static_cast<double>(flux.backface[0]) / kFluxScale, lights.flux()[0], 1e-6 * lights.flux()[0]);
}

/// Floor under a lamp, half of which a sheet hides: along x the lamp comes out from behind the sheet, along z the light
/// changes little.
class Penumbra : public testing::Test {
 protected:
  static constexpr std::uint32_t kAlong = 48, kAcross = 16, kPoints = 8;

  void SetUp() override {
    auto made = gpu::makeInProcessTransport(0, std::nullopt, gpu::Sight::kRays);
    if (!made) GTEST_SKIP() << made.error().text();
    transport_ = std::move(*made);
    SceneBuilder builder;
    floor_ = builder.add({{-0.12F, 0.0F, -0.04F}, {0, 0, 0.08F}, {0.24F, 0, 0}, kAcross, kAlong});
    lamp_ = builder.add({{-0.1F, 0.4F, -0.1F}, {0.2F, 0, 0}, {0, 0, 0.2F}, 1, 1});
    (void)builder.add({{-0.5F, 0.2F, -0.5F}, {0, 0, 1}, {0.5F, 0, 0}, 1, 1});
    (void)builder.add({{-0.5F, 0.2F, -0.5F}, {0.5F, 0, 0}, {0, 0, 1}, 1, 1});
    scene_ = builder.build();
    ASSERT_TRUE(transport_->setScene(scene_));
  }

  /// Irradiance of the floor, row by row along x. `key`: of receivers' own points; 0: the points of the batch.
  [[nodiscard]] std::vector<double> light(std::uint32_t points_a_side, std::uint64_t key, std::uint64_t seed) {
    std::mt19937 random(static_cast<std::uint32_t>(seed));
    auto batch = gatherFrom(*scene_, lamp_, points_a_side, random);
    auto& shot = batch.gather.front();
    if (points_a_side == 1) {  // as many as a sample has, all from one sequence
      const auto frame = batch.points.front();
      batch.points.clear();
      for (std::uint32_t i = 0; i < kPoints; ++i) {
        const auto at = solver::sobol4(i, seed);
        batch.points.push_back(frame);
        batch.points.back().origin = {-0.1 + 0.2 * at.x, 0.4, -0.1 + 0.2 * at.y};
      }
      shot.point_count = kPoints;
      shot.own_points_key = key;
    }
    auto flux = accumulators(*scene_);
    EXPECT_TRUE(transport_->run(batch, flux));
    std::vector<double> values;
    for (std::uint32_t along = 0; along < kAlong; ++along)
      for (std::uint32_t across = 0; across < kAcross; ++across)
        values.push_back(irradiance(*scene_, flux, floor_, across, along));
    return values;
  }

  std::unique_ptr<solver::Transport> transport_;
  std::shared_ptr<const scene::PatchScene> scene_;
  std::uint32_t floor_ = 0, lamp_ = 0;
};

TEST_F(Penumbra, IsGrainyAndNotSteppedByPointsOfTheReceiversOwn) {
  const auto truth = light(48, 0, 1);
  std::array<double, 2> of_leaf{}, of_row{};  // squares; by shared points, and by their own
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    for (const std::uint64_t key : {std::uint64_t{0}, seed}) {
      const auto found = light(1, key, seed);
      for (std::uint32_t along = 0; along < kAlong; ++along) {
        double sum = 0.0;
        for (std::uint32_t across = 0; across < kAcross; ++across) {
          const double off = found[along * kAcross + across] - truth[along * kAcross + across];
          of_leaf[key == 0 ? 0 : 1] += off * off;
          sum += off;
        }
        of_row[key == 0 ? 0 : 1] += sum * sum / kAcross;
      }
    }
  }
  // A row's leaves are off alike by the same points, so that their mean is no better than one of them.
  EXPECT_GT(of_row[0], 0.7 * of_leaf[0]);
  // By their own it is as good as that of independent leaves, or better: their points are spread evenly together.
  EXPECT_LT(of_row[1], 2.0 / kAcross * of_leaf[1]);
  EXPECT_NEAR(of_leaf[1] / of_leaf[0], 1.0, 0.5) << "and each leaf is as good as before";
}

}  // namespace
}  // namespace radiosity::test
