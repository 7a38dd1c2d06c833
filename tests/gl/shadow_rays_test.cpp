// What rays see where pixels cannot.
#include <gtest/gtest.h>

#include "server/gpu/workers/gpu_transport.h"
#include "server/solver/lamps/punctual_lights.h"
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

}  // namespace
}  // namespace radiosity::test
