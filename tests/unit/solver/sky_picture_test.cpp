// LinkedSolver under a picture of the sky: against two colours, closed forms and itself, turned and changed by edits.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/solver/lamps/sky_sources.h"
#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/shooting/shooting_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using std::numbers::pi;
using test::cubeQuads;
using test::kDark;
using test::kOpposite;
using test::makeQuadScene;
using test::openCube;
using test::RayTransport;

/// Of radiance(direction).
template <typename Radiance>
LightSources pictureOf(const Radiance& radiance, double turn_rad = 0.0, float strength = 1.0F) {
  scene::SkyImage image{128, 64, {}};
  for (std::size_t y = 0; y < image.height; ++y) {
    for (std::size_t x = 0; x < image.width; ++x) {
      const double polar = (static_cast<double>(y) + 0.5) / 64.0 * pi;
      const double azimuth = (2.0 * (static_cast<double>(x) + 0.5) / 128.0 - 1.0) * pi;
      image.texels.push_back(glm::vec3(static_cast<float>(radiance(
          glm::dvec3(std::sin(polar) * std::cos(azimuth), std::cos(polar), std::sin(polar) * std::sin(azimuth))))));
    }
  }
  LightSources sources;
  sources.sky.picture = scene::SharedSkyPicture(std::make_shared<const scene::SkyPicture>(std::move(image)));
  sources.sky.turn_rad = turn_rad;
  sources.sky.strength = strength;
  return sources;
}

template <typename Kind>
struct SolveBy {
  explicit SolveBy(const std::vector<test::Quad>& quads, const LightSources& sources) : made(makeQuadScene(quads)) {
    settings.target_error = 0.005;
    EXPECT_TRUE(rays.setScene(made.patches));
    solver = std::make_unique<Kind>(made.patches, made.materials, rays, settings, sources);
    EXPECT_EQ(test::runToEnd(*solver), StepOutcome::kConverged);
  }
  void light(const LightSources& sources) {
    solver->setLights(sources);
    EXPECT_EQ(test::runToEnd(*solver), StepOutcome::kConverged);
  }
  [[nodiscard]] double mean(std::size_t surface) const { return test::meanIrradiance(*solver, *made.patches, surface); }
  /// To what this transport knows of the light of lamps that leaves the scene.
  void expectBalance() const {
    const auto energy = solver->energy();
    EXPECT_NEAR(energy.imbalance[0], 0.0, 1e-3 * energy.emitted[0]);
    EXPECT_GE(energy.escaped[0], -5e-3 * energy.emitted[0]);
  }

  test::QuadScene made;
  RayTransport rays{64};
  SolverSettings settings;
  std::unique_ptr<Kind> solver;
};
using PictureSolve = SolveBy<LinkedSolver>;

const auto kTwoColours = [](const glm::dvec3& d) { return d.y > 0.0 ? 1.0 : 50.0; };
/// Bright towards +X, half as bright above.
const auto kSlope = [](const glm::dvec3& d) { return std::max(0.0, 1.0 + 0.8 * d.x + 0.2 * d.y); };

TEST(SkyPicture, OfTwoColoursIsTheTwoColours) {
  const PictureSolve lid(openCube(1, 0.0F), pictureOf(kTwoColours));
  EXPECT_NEAR(lid.mean(0), pi * kOpposite, 0.005 * pi * kOpposite);
  lid.expectBalance();
  const PictureSolve room(openCube(1, 0.7F), pictureOf(kTwoColours));
  LightSources two;
  two.sky = {glm::vec3(1.0F), glm::vec3(50.0F)};
  const PictureSolve colours(openCube(1, 0.7F), two);
  for (std::size_t surface = 0; surface < 5; ++surface)
    EXPECT_NEAR(room.mean(surface), colours.mean(surface), 0.01 * colours.mean(surface)) << surface;
  room.expectBalance();
}

// By lamps that draw their directions, and shots of all that they light: other code but for the leaves.
TEST(SkyPicture, ByRaysIsWhatItIsByLamps) {
  const auto sky = pictureOf(kSlope);
  const PictureSolve rays(openCube(1, 0.5F), sky);
  const SolveBy<ShootingSolver> shots(openCube(1, 0.5F), sky);
  for (std::size_t surface = 0; surface < 5; ++surface)
    EXPECT_NEAR(rays.mean(surface), shots.mean(surface), 0.02 * shots.mean(surface)) << surface;
  shots.expectBalance();
}

TEST(SkyPicture, TurnedIsAnEditThatCastsNoRay) {
  PictureSolve room(openCube(1, 0.5F), pictureOf(kSlope));
  const auto before = room.solver->irradiance();
  const auto rays = room.solver->linkCounters().rays;
  const std::array<double, 5> means{room.mean(0), room.mean(1), room.mean(2), room.mean(3), room.mean(4)};
  room.light(pictureOf(kSlope, pi));
  EXPECT_NE(room.solver->irradiance(), before);
  const PictureSolve fresh(openCube(1, 0.5F), pictureOf(kSlope, pi));
  for (std::size_t surface = 0; surface < 5; ++surface)
    EXPECT_NEAR(room.mean(surface), fresh.mean(surface), 0.01 * fresh.mean(surface)) << surface;
  // Half a turn is what mirrors the room: its walls change places.
  std::array<double, 5> turned{room.mean(0), room.mean(1), room.mean(2), room.mean(3), room.mean(4)}, sorted = means;
  std::ranges::sort(sorted);
  std::ranges::sort(turned);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_NEAR(turned[i], sorted[i], 0.01 * sorted[i]);
  room.light(pictureOf(kSlope, pi, 3.0F));
  for (std::size_t surface = 0; surface < 5; ++surface)
    EXPECT_NEAR(room.mean(surface), 3.0 * fresh.mean(surface), 0.03 * fresh.mean(surface)) << surface;
  room.light(pictureOf(kSlope));
  EXPECT_EQ(room.solver->irradiance(), before);
  EXPECT_EQ(room.solver->linkCounters().rays, rays);
}

// What few see may have another colour than what most see: a wall turned away from a white sun sees only the red one.
TEST(SkyPicture, OfTwoSunsHasTheColourOfEach) {
  constexpr double kWhite = 1e6, kRed = 1.5e4, kRadius = 0.05;
  scene::SkyImage image{512, 256, std::vector<glm::vec3>(512 * 256)};
  for (std::size_t i = 0; i < image.texels.size(); ++i) {
    const double polar = (static_cast<double>(i / 512) + 0.5) / 256.0 * pi;
    const double x = std::sin(polar) * std::cos((2.0 * (static_cast<double>(i % 512) + 0.5) / 512.0 - 1.0) * pi);
    if (x > std::cos(kRadius)) image.texels[i] = glm::vec3(kWhite);
    if (x < -std::cos(kRadius)) image.texels[i] = glm::vec3(kRed, 0.0, 0.0);
  }
  LightSources sources;
  sources.sky.picture = scene::SharedSkyPicture(std::make_shared<const scene::SkyPicture>(std::move(image)));
  // A square in the plane x = 0.5 that faces -X.
  PictureSolve wall({{{0.5F, 0.0F, 0.0F}, {0.0F, 0.0F, 1.0F}, {0.0F, 1.0F, 0.0F}}}, sources);
  const auto light = wall.solver->irradiance()[wall.made.patches->surfaces[0].first_node[0]];
  const double red = kRed * pi * std::sin(kRadius) * std::sin(kRadius);
  EXPECT_NEAR(static_cast<double>(light.x), red, 0.1 * red) << "texels cut the disc";
  EXPECT_LT(light.y, 1e-3F * light.x);
}

// What a solve that was given up had found of its sky is not that of the next.
TEST(SkyPicture, ThatGoesInTheMiddleOfASolveIsGone) {
  LightSources two;
  two.sky = {glm::vec3(1.0F), glm::vec3(0.5F)};
  const PictureSolve fresh(openCube(1, 0.5F), two);
  PictureSolve room(openCube(1, 0.5F), two);
  for (int steps = 1; steps < 40; steps += 3) {
    room.solver->setLights(pictureOf(kSlope));
    for (int i = 0; i < steps; ++i) ASSERT_TRUE(room.solver->step());
    room.light(two);
    for (std::size_t surface = 0; surface < 5; ++surface)
      EXPECT_NEAR(room.mean(surface), fresh.mean(surface), 1e-5 * fresh.mean(surface)) << steps;
  }
}

// Its rays knew only which half of the sky they met.
TEST(SkyPicture, ThatComesAfterTwoColoursCastsNoRay) {
  LightSources two;
  two.sky = {glm::vec3(1.0F), glm::vec3(0.5F)};
  PictureSolve room(openCube(1, 0.5F), two);
  const auto before = room.solver->irradiance();
  const auto rays = room.solver->linkCounters().rays;
  room.light(pictureOf(kSlope));
  const PictureSolve fresh(openCube(1, 0.5F), pictureOf(kSlope));
  for (std::size_t surface = 0; surface < 5; ++surface)
    EXPECT_NEAR(room.mean(surface), fresh.mean(surface), 0.01 * fresh.mean(surface)) << surface;
  EXPECT_EQ(room.solver->linkCounters().rays, rays);
  room.light(two);
  EXPECT_EQ(room.solver->irradiance(), before);
}

TEST(SkyPicture, WhatWasSavedGoesOnToTheSameEnd) {
  const auto sky = pictureOf(kSlope);
  PictureSolve room(openCube(1, 0.5F), sky);
  ArchiveWriter to(std::size_t{64} << 20);
  ASSERT_TRUE(room.solver->save(to));
  LinkedSolver next(room.made.patches, room.made.materials, room.rays, room.settings, sky);
  ArchiveReader from(to.bytes());
  ASSERT_TRUE(next.restore(from));
  next.assess();
  EXPECT_EQ(next.error().total, room.solver->error().total);
  EXPECT_EQ(next.irradiance(), room.solver->irradiance());
}

// A disc of five degrees, 10^4 times as bright as the sky: a lamp of its own, on a floor as its closed form has it.
TEST(SkyPicture, WithASunLightsAnOpenFloor) {
  const glm::dvec3 sun = glm::normalize(glm::dvec3(0.5, 0.8, 0.2));
  const double cosine = std::cos(5.0 * pi / 180.0);
  const auto radiance = [&](const glm::dvec3& d) { return glm::dot(d, sun) > cosine ? 1e4 : d.y > 0.0 ? 1.0 : 0.0; };
  const auto sky = pictureOf(radiance);
  ASSERT_FALSE(sky.sky.picture->bright().empty());
  std::vector<test::Quad> floor{cubeQuads(6, kDark, {})[0]};
  const PictureSolve open(floor, sky);
  double expected = 0.0;
  const auto& image = sky.sky.picture->image();
  for (std::size_t i = 0; i < image.texels.size() / 2; ++i) {
    const double top = std::cos(pi * static_cast<double>(i / 128) / 64.0);
    const double bottom = std::cos(pi * static_cast<double>(i / 128 + 1) / 64.0);
    expected += static_cast<double>(image.texels[i].x) * pi / 128.0 * (top * top - bottom * bottom);
  }
  EXPECT_NEAR(open.mean(0), expected, 0.01 * expected);
  EXPECT_GT(open.solver->error().total, 0.0);
  open.expectBalance();
}

TEST(Sun, OfHalfADegreeIsALampThatNothingHides) {
  LightSources sources;
  sources.sky.sun = scene::SkySun{glm::normalize(glm::dvec3(0.6, 0.8, 0.0)), glm::vec3(100.0F), 0.0093};
  const PictureSolve open(std::vector<test::Quad>{cubeQuads(6, kDark, {})[0]}, sources);
  EXPECT_NEAR(open.mean(0), 80.0, 0.01);
  open.expectBalance();
}

TEST(SkyLight, TellsCellsOfPicturesAndHalvesOfColours) {
  auto sources = pictureOf([](const glm::dvec3& d) { return 2.0 + d.x; }, 0.5 * pi);
  sources.sky.upper = glm::vec3(1.0F);
  const auto made = makeQuadScene({cubeQuads(6, kDark, {})[0]});
  const PunctualLights lights(*made.patches, {}, {});
  const SkyLight sky(lights.makeSources(*made.patches, sources));
  for (std::uint32_t cell = 0; cell < SkyCells::kCount; cell += 97) {
    const auto d = SkyCells::directionOf(cell);
    EXPECT_NEAR(sky.at(cell).x / pi, 2.0 - d.z + (d.y > 0.0 ? 1.0 : 0.0), 0.05) << "what was at +X is at -Z now";
  }
}

TEST(SkyCells, AreWhatTheirDirectionsLieIn) {
  double all = 0.0;
  for (std::uint32_t cell = 0; cell < SkyCells::kCount; ++cell) {
    EXPECT_EQ(SkyCells::of(SkyCells::directionOf(cell)), cell);
    all += SkyCells::extentOf(cell).solidAngle();
  }
  EXPECT_NEAR(all, 4.0 * pi, 1e-9);
  EXPECT_TRUE(SkyCells::isAbove(SkyCells::of({1, 0, 0})));
  EXPECT_FALSE(SkyCells::isAbove(SkyCells::of({-0.6, -1e-9, 0.8})));
  for (const auto& d : {glm::dvec3(0, 1, 0), glm::dvec3(0, -1, 0), glm::dvec3(-1, 0, 0), glm::dvec3(-1, 0, -1e-300)})
    EXPECT_LT(SkyCells::of(d), SkyCells::kCount);
}

}  // namespace
}  // namespace radiosity::solver
