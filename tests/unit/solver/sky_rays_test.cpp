// LinkedSolver where the light of the sky comes by rays, and rays that go on where something cuts a leaf.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/shooting/shooting_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::kDark;
using test::kOpposite;
using test::makeQuadScene;
using test::openCube;
using test::RayTransport;

std::array<float, 6> grey(float reflectance) {
  std::array<float, 6> all{};
  all.fill(reflectance);
  return all;
}

LightSources skyOf(float above, float below) {
  LightSources sources;
  sources.sky = {glm::vec3(above), glm::vec3(below)};
  return sources;
}

struct SkySolve {
  explicit SkySolve(test::QuadScene scene, const LightSources& sources, double target = 0.005)
      : made(std::move(scene)) {
    settings.target_error = target;
    EXPECT_TRUE(rays.setScene(made.patches));
    solver = std::make_unique<LinkedSolver>(made.patches, made.materials, rays, settings, sources);
    outcome = test::runToEnd(*solver);
  }
  [[nodiscard]] double mean(std::size_t surface) const { return test::meanIrradiance(*solver, *made.patches, surface); }

  test::QuadScene made;
  RayTransport rays{64};
  SolverSettings settings;
  std::unique_ptr<LinkedSolver> solver;
  StepOutcome outcome = StepOutcome::kSlice;
};

TEST(SkyRays, OfTheRightHalfComeThroughAnOpening) {
  const double whole = std::numbers::pi * kOpposite;
  const SkySolve lid(makeQuadScene(openCube(1, 0.0F)), skyOf(1.0F, 50.0F)),
      floor(makeQuadScene(openCube(0, 0.0F)), skyOf(50.0F, 2.0F));
  EXPECT_EQ(lid.outcome, StepOutcome::kConverged);
  EXPECT_NEAR(lid.mean(0), whole, 0.005 * whole);
  EXPECT_NEAR(floor.mean(0), 2.0 * whole, 0.01 * whole);  // the ceiling's
  EXPECT_EQ(lid.solver->transportCounters().pixels, 0U) << "no image";
  for (const auto& energy : {lid.solver->energy(), floor.solver->energy()}) {
    EXPECT_GT(energy.escaped[0], 0.0) << "most passes by";
    EXPECT_NEAR(energy.imbalance[0], 0.0, 1e-6 * energy.emitted[0]);
  }
}

// Averaged shooting has images of the sky, and shots of all that it lights: other code but for the leaves.
TEST(SkyRays, BringWhatShotsBring) {
  const auto made = makeQuadScene(openCube(5, 0.7F));
  const auto sky = skyOf(1.0F, 0.3F);
  const SkySolve rays(made, sky);
  ASSERT_EQ(rays.outcome, StepOutcome::kConverged);
  SolverSettings settings;
  settings.target_error = 0.02;
  RayTransport transport(64);
  ASSERT_TRUE(transport.setScene(made.patches));
  ShootingSolver shots(made.patches, made.materials, transport, settings, sky);
  test::solve(shots);
  double square = 0.0, difference = 0.0;
  const auto by_rays = rays.solver->irradiance(), by_shots = shots.irradiance();
  for (const auto& side : makeSides(*made.patches)) {
    for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node) {
      const glm::dvec3 a(by_rays[node]), b(by_shots[node]);
      square += static_cast<double>(made.patches->node_area[node]) * glm::dot(b, b);
      difference += static_cast<double>(made.patches->node_area[node]) * glm::dot(a - b, a - b);
    }
  }
  // This transport brings a sky to the middles of leaves.
  EXPECT_LT(std::sqrt(difference / square), 1.5 * std::hypot(rays.solver->error().total, shots.error().total));
  const auto energy = rays.solver->energy();
  EXPECT_NEAR(energy.imbalance[0], 0.0, 1e-6 * energy.emitted[0]);
}

TEST(SkyRays, AnotherSkyAndBackGivesTheSameBits) {
  SkySolve room(makeQuadScene(openCube(1, 0.5F)), skyOf(1.0F, 0.0F));
  const auto before = room.solver->irradiance();
  const auto rays = room.solver->linkCounters().rays;
  room.solver->setLights(skyOf(3.0F, 0.0F));
  EXPECT_EQ(test::runToEnd(*room.solver), StepOutcome::kConverged);
  const auto brighter = room.solver->irradiance();
  for (std::size_t node = 0; node < before.size(); ++node)
    ASSERT_NEAR(brighter[node].x, 3.0F * before[node].x, 1e-4F * before[node].x);
  room.solver->setLights(skyOf(0.0F, 0.0F));
  EXPECT_EQ(test::runToEnd(*room.solver), StepOutcome::kConverged);
  EXPECT_EQ(room.mean(0), 0.0);
  room.solver->setLights(skyOf(1.0F, 0.0F));
  EXPECT_EQ(test::runToEnd(*room.solver), StepOutcome::kConverged);
  EXPECT_EQ(room.solver->irradiance(), before);
  EXPECT_EQ(room.solver->linkCounters().rays, rays);
}

TEST(SkyRays, ASkyThatComesToADarkSceneLightsIt) {
  SkySolve room(makeQuadScene(openCube(1, 0.5F)), {});
  EXPECT_EQ(room.solver->error().total, 0.0);
  room.solver->setLights(skyOf(1.0F, 0.0F));
  EXPECT_EQ(test::runToEnd(*room.solver), StepOutcome::kConverged);
  const SkySolve fresh(makeQuadScene(openCube(1, 0.5F)), skyOf(1.0F, 0.0F));
  EXPECT_NEAR(room.mean(0), fresh.mean(0), 0.01 * fresh.mean(0));
}

TEST(SkyRays, WhatWasSavedGoesOnToTheSameEnd) {
  SkySolve room(makeQuadScene(openCube(1, 0.5F)), skyOf(1.0F, 0.5F));
  ArchiveWriter to(std::size_t{64} << 20);
  ASSERT_TRUE(room.solver->save(to));
  LinkedSolver next(room.made.patches, room.made.materials, room.rays, room.settings, skyOf(1.0F, 0.5F));
  ArchiveReader from(to.bytes());
  ASSERT_TRUE(next.restore(from));
  next.assess();
  EXPECT_EQ(next.error().total, room.solver->error().total);
  EXPECT_EQ(next.energy().escaped, room.solver->energy().escaped);
  EXPECT_EQ(next.irradiance(), room.solver->irradiance());
}

/// A cube open to the left that a wall parts in two. Of five columns of leaves it stands on the middle one.
test::QuadScene partedCube(bool is_cut, float reflectance = 0.9F, float thickness = 0.0F) {
  auto quads = cubeQuads(5, kDark, grey(reflectance));
  quads.erase(quads.begin() + 4);
  const glm::vec3 low(0.0F, -0.5F, -0.5F), y(0, 1, 0), z(0, 0, 1), half(0.5F * thickness, 0, 0);
  quads.push_back({low + half, y, z, 5, 5, {}, glm::vec3(reflectance)});
  quads.push_back({low - half, z, y, 5, 5, {}, glm::vec3(reflectance)});
  auto made = makeQuadScene(quads);
  for (std::size_t s = 0; s < 4; ++s) {
    const auto& surface = made.patches->surfaces[s];
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      auto& leaf = made.patches->leaves[surface.first_leaf + i];
      const auto& frame = made.patches->triangles[leaf.triangle];
      const auto x = frame.origin.x + leaf.texel.x * frame.du.x + leaf.texel.y * frame.dv.x;
      leaf.cut = is_cut && std::abs(x) < 0.05F;
    }
  }
  return made;
}

TEST(CutLeaves, LetNoLightThroughAWall) {
  const SkySolve blind(partedCube(false), skyOf(1.0F, 1.0F)), room(partedCube(true), skyOf(1.0F, 1.0F));
  constexpr std::size_t kRight = 4, kWallRight = 5, kWallLeft = 6;
  ASSERT_GT(blind.mean(kRight), 0.05 * blind.mean(kWallLeft)) << "through the middle of the floor";
  for (const auto surface : {kRight, kWallRight}) EXPECT_NEAR(room.mean(surface), 0.0, 1e-5) << surface;
  EXPECT_GT(room.mean(kWallLeft), 0.5 * std::numbers::pi);
  const auto energy = room.solver->energy();
  EXPECT_NEAR(energy.imbalance[0], 0.0, 1e-6 * energy.emitted[0]);
}

// The middle leaves lie in part inside the wall, and nothing says so but what their rays see.
TEST(PartlyInside, LetNoLightThroughAWall) {
  const SkySolve room(partedCube(false, 0.9F, 0.1F), skyOf(1.0F, 1.0F));
  constexpr std::size_t kRight = 4, kWallRight = 5, kWallLeft = 6;
  for (const auto surface : {kRight, kWallRight}) EXPECT_NEAR(room.mean(surface), 0.0, 1e-5) << surface;
  EXPECT_GT(room.mean(kWallLeft), 0.5 * std::numbers::pi);
  const auto energy = room.solver->energy();
  EXPECT_NEAR(energy.imbalance[0], 0.0, 1e-6 * energy.emitted[0]);
}

// Where all leaves are cut rays end somewhere, and nobody knows on which side of what.
TEST(CutLeaves, WithoutEndAreStatedAsDoubtful) {
  auto made = partedCube(true, 0.999F);
  for (auto& leaf : made.patches->leaves) leaf.cut = true;
  const SkySolve room(std::move(made), skyOf(1.0F, 1.0F));
  const auto& right = room.made.patches->surfaces[4];
  const auto squares = room.solver->commonErrorSquared();
  const auto light = room.solver->irradiance();
  ASSERT_GT(room.mean(4), 0.1) << "truth is none";
  for (auto node = right.first_node[0]; node < right.first_node[0] + right.width * right.height; ++node)
    EXPECT_LE(light[node].x, 1.01F * std::sqrt(squares[node].x));
  EXPECT_GT(room.solver->error().total, 0.1);
}

TEST(CutLeaves, TakeNoMoreStepsThanThereIsMemoryFor) {
  const auto made = makeQuadScene(cubeQuads(32, kDark, grey(0.5F)));
  for (auto& leaf : made.patches->leaves) leaf.cut = true;
  const auto sides = makeSides(*made.patches);
  LeafSights free(*made.patches, sides, 1), bound(*made.patches, sides, 1), sliced(*made.patches, sides, 1);
  const std::vector<std::uint16_t> counts(free.leafCount(), 2);
  constexpr std::size_t kStepBytes = 32, kSlice = std::size_t{2048} * 2 * 32 * (8 + kStepBytes);
  const auto most = bound.bytes() + kSlice;
  for (auto* sights : {&bound, &sliced}) sights->limit(most, kStepBytes);
  for (auto* sights : {&free, &bound, &sliced}) sights->ask(counts);
  ASSERT_TRUE(free.trace(HUGE_VAL));
  ASSERT_TRUE(bound.trace(HUGE_VAL));
  while (!sliced.trace(0.0)) continue;
  const auto taken = [](const LeafSights& sights) {
    return sights.bytes() + kStepBytes * (sights.steps(0).size() + sights.steps(1).size());
  };
  EXPECT_GT(taken(free), 5 * kSlice);
  EXPECT_LE(taken(bound), most);
  EXPECT_GT(taken(bound), most / 2) << "it goes on as long as it can";
  EXPECT_EQ(taken(bound), taken(sliced));
  const auto last = bound.leafCount() - 1;
  EXPECT_LT(bound.seen(0, last)[0], bound.leafCount()) << "it does not go on";
  EXPECT_TRUE(bound.isDoubtful(0, bound.seen(0, last)[0]));
  EXPECT_TRUE(bound.isDoubtful(1, bound.seen(1, 0)[0]));
}

// Light behind the wall where there should be none: that is stated.
TEST(CutLeaves, WithoutMemoryToGoOnAreStatedAsDoubtful) {
  const auto made = partedCube(true);
  const auto sides = makeSides(*made.patches);
  LeftLight light;
  for (const auto& side : sides) {
    light.emission.insert(light.emission.end(), side.leaf_count, glm::vec3(0.0F));
    light.reflectance.insert(light.reflectance.end(), side.leaf_count, glm::vec3(0.9F));
  }
  for (auto& half : light.irradiance) half.assign(light.emission.size(), glm::vec3(0.0F));
  light.shot = light.irradiance;
  light.sky = {glm::dvec3(1.0), glm::dvec3(1.0)};
  const auto behind = [&](std::size_t most_bytes, double& doubt) {
    LeafGather gather(*made.patches, sides, 1, most_bytes);
    gather.start();
    gather.begin(light);
    while (!gather.advance(1.0)) continue;
    doubt = gather.doubt();
    double sum = 0.0;
    for (const auto& side : sides) {
      for (auto v = side.first_value; side.surface == 4 && v < side.first_value + side.leaf_count; ++v)
        sum += static_cast<double>(made.patches->node_area[side.first_node + v - side.first_value]) *
               std::pow(static_cast<double>(gather.irradiance(0)[v].x), 2.0);
    }
    return sum;
  };
  double ample_doubt = 0.0, short_doubt = 0.0;
  EXPECT_NEAR(behind(std::size_t{1} << 30, ample_doubt), 0.0, 1e-10);
  EXPECT_EQ(ample_doubt, 0.0);
  const double wrong = behind(LeafGather::leastBytes(made.patches->leaves.size()), short_doubt);
  EXPECT_GT(wrong, 1e-4) << "they are not short";
  EXPECT_GT(short_doubt, wrong);
}

// Rays that never get out know what comes over links to where they go on, but for what changes within leaves.
TEST(CutLeaves, AreInDoubtOfLightThatChangesFromLeafToLeaf) {
  const auto made = makeQuadScene(cubeQuads(8, kDark, grey(0.5F)));
  for (auto& leaf : made.patches->leaves) leaf.cut = true;
  const auto sides = makeSides(*made.patches);
  const auto relative = [&](float change) {
    LeftLight light;
    const auto leaves = sides.back().first_value + sides.back().leaf_count;
    light.emission.assign(leaves, glm::vec3(0.0F));
    light.reflectance.assign(leaves, glm::vec3(0.5F));
    light.shot[0] = light.shot[1] = light.emission;
    for (auto& half : light.irradiance) {
      for (std::uint32_t v = 0; v < leaves; ++v)
        half.emplace_back((v % 8 + v / 8) % 2 == 0 ? 1.0F + change : 1.0F - change);
    }
    LeafGather gather(*made.patches, sides, 1, std::size_t{1} << 30);
    gather.start();
    gather.begin(light);
    while (!gather.advance(1.0)) continue;
    double sum = 0.0;  // over areas of one in all
    for (const auto& x : gather.irradiance(0)) sum += static_cast<double>(glm::dot(x, x)) / leaves;
    return std::sqrt(gather.doubt() / 6.0 / sum);
  };
  EXPECT_LT(relative(0.0F), 1e-6);
  EXPECT_GT(relative(1.0F), 0.2);
  EXPECT_NEAR(relative(0.5F), 0.5 * relative(1.0F), 0.05 * relative(1.0F));
}

// Which leaves lie in part inside of something rays alone tell, and they are traced anew when they are needed.
TEST(PartlyInside, AreSavedWithAllElse) {
  const SkySolve room(partedCube(false, 0.9F, 0.1F), skyOf(1.0F, 1.0F), 0.02);
  ArchiveWriter to(std::size_t{64} << 20);
  ASSERT_TRUE(room.solver->save(to));
  auto transport = room.rays;
  LinkedSolver next(room.made.patches, room.made.materials, transport, room.settings, skyOf(1.0F, 1.0F));
  ArchiveReader from(to.bytes());
  ASSERT_TRUE(next.restore(from));
  next.assess();
  EXPECT_EQ(next.error().total, room.solver->error().total);
  EXPECT_EQ(next.error().variation, room.solver->error().variation);
}

TEST(CutLeaves, NoMoreThreadsNorSlicesChangeABit) {
  const auto made = partedCube(true);
  const auto sides = makeSides(*made.patches);
  LeafSights at_once(*made.patches, sides, 1), sliced(*made.patches, sides, 1);
  std::vector<std::uint16_t> counts(at_once.leafCount(), 8);
  at_once.ask(counts);
  ASSERT_TRUE(at_once.trace(HUGE_VAL));
  sliced.ask(counts);
  while (!sliced.trace(0.0)) continue;
  std::ranges::fill(counts, std::uint16_t{16});
  for (auto* sights : {&at_once, &sliced}) {
    sights->ask(counts);
    ASSERT_TRUE(sights->trace(HUGE_VAL));
  }
  ASSERT_GT(at_once.steps(0).size(), 100U);
  for (std::uint32_t value = 0; value < at_once.leafCount(); ++value)
    EXPECT_TRUE(std::ranges::equal(at_once.seen(1, value), sliced.seen(1, value)));
  // Half of the rays are given up: so are their steps.
  const auto steps = at_once.steps(0).size();
  std::ranges::fill(counts, std::uint16_t{8});
  at_once.ask(counts);
  EXPECT_LT(at_once.steps(0).size(), steps);
  EXPECT_TRUE(at_once.trace(HUGE_VAL));
}

}  // namespace
}  // namespace radiosity::solver
