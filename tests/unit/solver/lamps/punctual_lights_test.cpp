#include "server/solver/lamps/punctual_lights.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <type_traits>

#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/shooting/shooting_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;
using test::RayTransport;
using test::solve;

constexpr double kPi = std::numbers::pi;

LightSources lamp(float candela) { return {{{.position = {0.1, 0.2, 0.0}, .intensity = glm::vec3(candela)}}, {}}; }

double received(const scene::PatchScene& patches, const Solver& solver) {
  const auto light = solver.irradiance();
  double sum = 0.0;
  for (const auto& surface : patches.surfaces) {
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      const auto node = surface.first_node[0] + leaf;
      sum += static_cast<double>(light[node].x) * static_cast<double>(patches.node_area[node]);
    }
  }
  return sum;
}

TEST(PunctualLights, FluxIsFourPiIOfAPointTheConesIntegralOfASpotAndWhatEntersTheBoxFromInfinity) {
  const auto made = makeQuadScene(cubeQuads(4, {}, {}));  // a box of side 1
  const auto flux = [&](const LightSources& sources) { return PunctualLights(*made.patches, sources, {}).flux()[0]; };
  EXPECT_NEAR(flux(lamp(2.0F)), 8.0 * kPi, 1e-6);
  scene::PunctualLight spot{.kind = scene::LightKind::kSpot, .intensity = glm::vec3(1.0F)};
  spot.inner_cone_rad = 0.3;
  spot.outer_cone_rad = 0.9;
  // the falloff is the square of a ramp in the cosine: a third of its width, and all inside the inner cone
  const double ramp = std::cos(0.3) - std::cos(0.9);
  EXPECT_NEAR(flux({{spot}, {}}), 2.0 * kPi * (ramp / 3.0 + 1.0 - std::cos(0.3)), 1e-4);
  const scene::PunctualLight sun{
      .kind = scene::LightKind::kDirectional, .direction = {0.0, -0.6, -0.8}, .intensity = glm::vec3(3.0F)};
  EXPECT_NEAR(flux({{sun}, {}}), 3.0 * 1.4, 1e-5);
  EXPECT_NEAR(flux({{}, {glm::vec3(1.0F), glm::vec3(1.0F)}}), 6.0 * kPi, 1e-5);
  EXPECT_NEAR(flux({{}, {glm::vec3(1.0F), glm::vec3(0.0F)}}), 3.0 * kPi, 1e-5);
}

TEST(PunctualLights, CandelaAreScaledFromMetresToTheUnitBox) {
  auto made = makeQuadScene(cubeQuads(4, {}, {}));
  made.patches->scale = 10.0;
  made.patches->centre = {5.0, 0.0, 0.0};
  PunctualLights lights(*made.patches,
                        {{{.position = {6.0, 0.0, 0.0}, .intensity = glm::vec3(200.0F), .range = 5.0}}, {}}, {});
  ShotBatch batch;
  lights.addSlice(1, batch);
  ASSERT_FALSE(batch.point_lights.empty());
  const auto& shot = batch.point_lights[0];
  EXPECT_NEAR(static_cast<double>(shot.frame.origin.x), 0.1, 1e-6);
  EXPECT_NEAR(static_cast<double>(shot.range), 0.5, 1e-6);
  // four images in a round, two of either half: each carries a quarter of 200 cd / (10 m)^2
  EXPECT_NEAR(shot.intensity[0], 0.5, 1e-9);
}

TEST(PunctualLights, APointLightVeryFarAwayShinesAsADirectionalOneOfTheSameIrradiance) {
  const auto made = makeQuadScene(cubeQuads(4, {}, {}));
  PunctualLights lights(*made.patches, {{{.position = {0.0, 3e8, 4e8}, .intensity = glm::vec3(5e17F)}}, {}}, {});
  ShotBatch batch;
  lights.addSlice(1, batch);
  EXPECT_TRUE(batch.point_lights.empty());
  ASSERT_EQ(batch.parallel.size(), 4U);
  EXPECT_NEAR(batch.parallel[0].irradiance[0], 0.5, 1e-6);  // a quarter of 5e17 / (5e8)^2 lux
  EXPECT_NEAR(static_cast<double>(batch.views[0].direction.y), 0.6, 1e-6);
  // positions and ranges that no float holds give no NaN
  const PunctualLights odd(*made.patches,
                           {{{.position = {1e300, 0, 0}, .intensity = glm::vec3(1.0F)},
                             {.position = {0.1, 0, 0}, .intensity = glm::vec3(1.0F), .range = 1e-60}},
                            {}},
                           {});
  EXPECT_TRUE(std::isfinite(odd.flux()[0]));
}

TEST(PunctualLights, EveryRoundOwesTheSourcesOnceAndAnEditOwesTheDifferenceOfAllRounds) {
  const auto made = makeQuadScene(cubeQuads(4, {}, {}));
  PunctualLights lights(*made.patches, lamp(2.0F), {});
  const double once = 3.0 * 8.0 * kPi;  // three channels
  EXPECT_NEAR(lights.owed(1), once, 1e-6);
  const auto carry = [&](std::uint32_t rounds) {
    while (lights.hasSlice(rounds)) {
      ShotBatch batch;
      lights.addSlice(rounds, batch);
    }
  };
  carry(1);
  EXPECT_EQ(lights.owed(1), 0.0);
  EXPECT_NEAR(lights.owed(3), 2.0 * once, 1e-6);
  carry(3);
  lights.setSources(*made.patches, lamp(1.0F));
  EXPECT_NEAR(lights.owed(3), 1.5 * once, 1e-6);
  carry(3);
  EXPECT_EQ(lights.owed(3), 0.0);
}

TEST(PunctualLights, WhatIsPlannedButNotCarriedIsStillOwed) {
  const auto made = makeQuadScene(cubeQuads(4, {}, {}));
  PunctualLights lights(*made.patches, {{}, {glm::vec3(1.0F), glm::vec3(1.0F)}}, {});
  const double all = lights.owed(1);
  ShotBatch batch;
  lights.addSlice(1, batch);
  EXPECT_TRUE(lights.hasSlice(1));
  EXPECT_NEAR(lights.owed(1), 0.75 * all, 1e-6);  // one half of one hemisphere
}

TEST(PunctualLights, TwoLightsInOnePlaceShineAsOne) {
  const auto made = makeQuadScene(cubeQuads(4, {}, {}));
  auto sources = lamp(2.0F);
  sources.lights.push_back(sources.lights[0]);
  ShotBatch one, two;
  PunctualLights(*made.patches, lamp(4.0F), {}).addSlice(1, one);
  PunctualLights(*made.patches, sources, {}).addSlice(1, two);
  ASSERT_EQ(one.point_lights.size(), two.point_lights.size());
  for (std::size_t i = 0; i < one.point_lights.size(); ++i) {
    EXPECT_EQ(one.point_lights[i].intensity, two.point_lights[i].intensity);
  }
}

/// Both ways to solve must agree with the same truths.
template <typename Kind>
class SolverLights : public ::testing::Test {};
using Kinds = ::testing::Types<LinkedSolver, ShootingSolver>;
TYPED_TEST_SUITE(SolverLights, Kinds);

TYPED_TEST(SolverLights, AClosedGreyRoomReceivesTheLampOverOneMinusReflectance) {
  auto made = makeQuadScene(cubeQuads(8, {}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F}));
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  SolverSettings settings;
  settings.target_error = 0.02;
  TypeParam solver(made.patches, made.materials, rays, settings, lamp(1.0F));
  solve(solver);
  // Light at leaf middles: the midpoint rule on 8 x 8 leaves, a few tenths of a percent.
  EXPECT_NEAR(received(*made.patches, solver), 4.0 * kPi / 0.5, 0.02 * 8.0 * kPi);
  const auto energy = solver.energy();
  EXPECT_NEAR(energy.emitted[0], 4.0 * kPi, 1e-5);
  const double sum =
      energy.absorbed[0] + energy.escaped[0] + energy.backface[0] + energy.unshot[0] + energy.imbalance[0];
  EXPECT_NEAR(sum / energy.emitted[0], 1.0, 1e-5);
}

TYPED_TEST(SolverLights, AnEditOfALampIsSolvedOnFromWhereItWas) {
  auto made = makeQuadScene(cubeQuads(6, {0, 1, 0, 0, 0, 0}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F}));
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  SolverSettings settings;
  settings.target_error = 0.02;
  TypeParam edited(made.patches, made.materials, rays, settings, lamp(1.0F));
  solve(edited);
  const auto rounds = edited.rounds();
  edited.setLights(lamp(0.5F));
  if (std::is_same_v<TypeParam, ShootingSolver>) {
    EXPECT_GT(edited.error().total, 0.02) << "it knows that it is not done";
  }
  EXPECT_EQ(edited.rounds(), rounds);
  solve(edited);
  TypeParam fresh(made.patches, made.materials, rays, settings, lamp(0.5F));
  solve(fresh);
  EXPECT_NEAR(received(*made.patches, edited) / received(*made.patches, fresh), 1.0, 0.01);
}

TYPED_TEST(SolverLights, WithTheLampGoneTheRoomIsAsDarkAsWithoutIt) {
  auto made = makeQuadScene(cubeQuads(6, {}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F}));
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  TypeParam solver(made.patches, made.materials, rays, SolverSettings{}, lamp(1.0F));
  solve(solver);
  const double before = received(*made.patches, solver);
  solver.setLights({});
  for (int i = 0; i < 400; ++i) ASSERT_TRUE(solver.step());
  EXPECT_NEAR(received(*made.patches, solver), 0.0, 0.01 * before);
}

/// Of one square metre and `nits`, below the ceiling of the box.
LightSources panel(float nits, double half = 0.1) {
  scene::PunctualLight light{.kind = scene::LightKind::kRectangle, .position = {0.1, 0.2, 0.3}};
  light.intensity = glm::vec3(nits);
  light.half = {half, 0.2};
  return {{light}, {}};
}

TEST(PunctualLights, AnAreaLightSendsItsRadianceTimesPiTimesItsArea) {
  auto made = makeQuadScene(cubeQuads(4, {}, {}));
  const auto flux = [&] { return PunctualLights(*made.patches, panel(50.0F), {}).flux()[0]; };
  EXPECT_NEAR(flux(), 50.0 * kPi * 0.08, 1e-5);
  made.patches->scale = 10.0;
  EXPECT_NEAR(flux(), 50.0 * kPi * 0.08 / 100.0, 1e-7) << "of the unit box";
}

TEST(PunctualLights, ALampFarAwayIsADirectionalLight) {
  const auto made = makeQuadScene(cubeQuads(4, {}, {}));
  auto sources = panel(50.0F);
  sources.lights[0].position = {0.0, 0.0, 1e6};
  ShotBatch batch;
  PunctualLights(*made.patches, sources, {}).addSlice(1, batch);
  EXPECT_TRUE(batch.lamps.empty());
  ASSERT_FALSE(batch.parallel.empty());
  sources.lights[0].direction = {0.0, 0.0, 1.0};  // it shines the other way
  EXPECT_EQ(PunctualLights(*made.patches, sources, {}).flux()[0], 0.0);
}

TYPED_TEST(SolverLights, AClosedGreyRoomReceivesAPanelOverOneMinusReflectance) {
  auto made = makeQuadScene(cubeQuads(8, {}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F}));
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  TypeParam solver(made.patches, made.materials, rays, SolverSettings{}, panel(50.0F));
  solve(solver);
  const double sent = 50.0 * kPi * 0.08;
  EXPECT_NEAR(received(*made.patches, solver) / (sent / 0.5), 1.0, 0.03);
}

TEST(LinkedLamps, AnEditOfStrengthOrColourLooksAtNothingAnewAndOneOfSizeDoes) {
  auto made = makeQuadScene(cubeQuads(6, {}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F}));
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  LinkedSolver solver(made.patches, made.materials, rays, SolverSettings{}, panel(50.0F));
  solve(solver);
  const double before = received(*made.patches, solver);
  const auto looks = solver.transportCounters().point_images;
  auto other = panel(100.0F);
  solver.setLights(other);
  solve(solver);
  EXPECT_NEAR(received(*made.patches, solver) / before, 2.0, 0.01);
  EXPECT_EQ(solver.transportCounters().point_images, looks);
  other.lights[0].half.x = 0.2;
  solver.setLights(other);
  solve(solver);
  EXPECT_GT(solver.transportCounters().point_images, looks);
}

TEST(LampLooks, AreTheClosedFormWhereAllIsSeenAndNothingWhereNoneIs) {
  LampLooks seen, hidden;
  for (const float brings : {0.5F, 1.5F, 3.0F}) {
    seen.ask(2.0F, brings);
    seen.see(2.0F, brings);
    hidden.ask(2.0F, brings);
  }
  EXPECT_FLOAT_EQ(seen.irradiance(3), 2.0F);
  EXPECT_EQ(hidden.irradiance(3), 0.0F);
  EXPECT_EQ(LampLooks().irradiance(3), 0.0F);
}

TEST(LampLooks, AreRightInTheMeanWhereAPartIsSeen) {
  // Points bring 1 or 3, half of each are there; those that bring 3 are seen.
  double sum = 0.0;
  for (std::uint32_t bits = 0; bits < 256; ++bits) {
    LampLooks looks;
    for (std::uint32_t k = 0; k < 8; ++k) {
      const bool strong = (bits >> k & 1U) != 0;
      looks.ask(2.0F, strong ? 3.0F : 1.0F);
      if (strong) looks.see(2.0F, 3.0F);
    }
    sum += static_cast<double>(looks.irradiance(8)) / 256.0;
  }
  EXPECT_NEAR(sum, 1.5, 0.01);
}

}  // namespace
}  // namespace radiosity::solver
