// A wave in slices is the wave as a whole, whatever happens between the slices.
#include "server/solver/transport/wave.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "server/solver/shooting/shooting_solver.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;
using test::QuadScene;
using test::RayTransport;

QuadScene litCube() { return makeQuadScene(cubeQuads(4, {0, 4, 0, 0, 0, 0}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F})); }

/// Direct light of the scene and shots from a wall: too much for the first slice.
ShotBatch someBatch(const QuadScene& made) {
  RadiosityState state(made.patches, made.materials);
  auto lights = findLightPolygons(*made.patches, state.sides(), state.emissions());
  DirectShots shots({}, made.patches->leaves.size());
  shots.take(lights);
  shots.startRound(1);
  std::array<double, 3> flux{};
  ShotBatch batch = shots.next(flux);
  batch.flux_scale = state.fluxScale();
  for (std::uint32_t i = 0; i < 60; ++i) {
    ScatterShot shot;
    shot.frame = batch.points.front();
    shot.frame.lattice = i % 16;
    shot.flux = {1.0, 0.5, 0.1 * i};
    shot.half = i % 2;
    batch.scatter.push_back(shot);
  }
  return batch;
}

TEST(Wave, SlicesDeliverTheBitsOfTheWhole) {
  const auto made = litCube();
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  const auto batch = someBatch(made);
  FluxAccumulators whole;
  whole.reset(made.patches->nodeCount());
  const auto expected = rays.run(batch, whole);
  ASSERT_TRUE(expected);

  Wave wave;
  TransportCounters counters;
  for (int again = 0; again < 2; ++again) {  // the second wave is cut by the measured rate
    counters = {};
    wave.begin(batch, *made.patches);
    int slices = 1;
    for (auto last = wave.advance(rays, counters); !last.value(); last = wave.advance(rays, counters)) ++slices;
    EXPECT_GT(again + slices, 1) << "the first wave in one slice";
    EXPECT_FALSE(wave.underWay());
    EXPECT_EQ(wave.flux().node, whole.node);
    EXPECT_EQ(wave.flux().gathered, whole.gathered);
    EXPECT_EQ(wave.flux().scattered, whole.scattered);
    EXPECT_EQ(wave.flux().escaped, whole.escaped);
    EXPECT_EQ(wave.flux().backface, whole.backface);
    EXPECT_EQ(counters.scatter_shots, expected->scatter_shots);
    EXPECT_EQ(counters.gather_points, expected->gather_points);
  }
}

TEST(Wave, AnEmptyOneIsDoneInOneSlice) {
  const auto made = litCube();
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  Wave wave;
  TransportCounters counters;
  wave.begin({}, *made.patches);
  EXPECT_TRUE(wave.advance(rays, counters).value());
}

TEST(Wave, LightUnderWayIsUnshotInTheBalanceAndInTheError) {
  const auto made = litCube();
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  ShootingSolver solver(made.patches, made.materials, rays, SolverSettings{});
  ASSERT_EQ(solver.step().value(), StepOutcome::kSlice) << "all direct light in one slice";
  const auto energy = solver.energy();
  EXPECT_NEAR(energy.unshot[0], energy.emitted[0], 1e-5 * energy.emitted[0]);
  EXPECT_NEAR(energy.imbalance[0], 0.0, 1e-5 * energy.emitted[0]);
  solver.assess();
  EXPECT_EQ(solver.error().total, 1.0);
}

/// Mean irradiance of the wall opposite the lamp.
double meanOfFirst(const QuadScene& made, const Solver& solver) {
  const auto light = solver.irradiance();
  double sum = 0.0;
  for (std::uint32_t leaf = 0; leaf < 16; ++leaf)
    sum += static_cast<double>(light[made.patches->surfaces[0].first_node[0] + leaf].x);
  return sum / 16.0;
}

/// Solves; with `edit`, the lamp is made twice as bright while the first wave is under way.
double solvedMean(bool edit) {
  const auto made = litCube();
  auto bright = cubeQuads(4, {0, 8, 0, 0, 0, 0}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F});
  RayTransport rays(64);
  EXPECT_TRUE(rays.setScene(made.patches));
  SolverSettings settings;
  settings.target_error = 0.02;
  ShootingSolver solver(made.patches, made.materials, rays, settings);
  EXPECT_EQ(solver.step().value(), StepOutcome::kSlice);
  if (edit) solver.setMaterials(makeQuadScene(bright).materials);
  for (int i = 0; i < 100000 && solver.step().value() != StepOutcome::kConverged; ++i) {
  }
  EXPECT_LE(solver.error().total, 0.02);
  const auto energy = solver.energy();
  const double sum =
      energy.absorbed[0] + energy.escaped[0] + energy.backface[0] + energy.unshot[0] + energy.imbalance[0];
  EXPECT_NEAR(sum / energy.emitted[0], 1.0, 1e-5);
  return meanOfFirst(made, solver);
}

TEST(Wave, AnEditWhileOneIsUnderWayLosesAndDoublesNothing) {
  // Both solves state 2 %; a wave lost or counted twice would be half of the light.
  EXPECT_NEAR(solvedMean(true) / solvedMean(false), 2.0, 2.0 * 2.0 * 0.02);
}

}  // namespace
}  // namespace radiosity::solver
