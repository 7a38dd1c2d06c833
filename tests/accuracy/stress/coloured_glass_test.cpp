// Coloured glass: closed forms, and the path tracer, which carries each channel by itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "tests/accuracy/stress/glass_scenes.h"
#include "tests/accuracy/stress/leaves.h"
#include "tests/accuracy/stress/stress_solve.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::Material;
using test_scenes::Object;
using test_scenes::TestScene;

const glm::dvec3 kRed(0.9, 0.3, 0.05), kBlue(0.1, 0.5, 0.8);

class ColouredGlass : public testing::TestWithParam<bool> {};

TEST_P(ColouredGlass, PassesOfTheSunItsColour) {
  for (const double angle : {0.0, 1.2}) {
    for (const bool has_two : {false, true}) {
      std::vector panes{glassOf(kRed, GetParam())};
      if (has_two) panes.push_back(glassOf(kBlue, GetParam()));
      auto scene = floorBelow(panes, false);
      test_scenes::Light sun;
      sun.kind = test_scenes::Light::Kind::kDirectional;
      sun.target = {std::sin(angle), -std::cos(angle), 0.0};
      sun.intensity = glm::dvec3(100.0);
      scene.lights.push_back(sun);
      Solve solve(loadGlb(test_scenes::encodeGlb(scene), texelsOf(0.25)), settingsOf(0.005));
      (void)solve.run();  // a black floor reflects nothing, so that there may be nothing left to refine
      const double cosine = std::cos(angle), face = 1.0 - reflectanceAt(cosine);
      const auto truth = 100.0 * cosine * (has_two ? face * face * kRed * kBlue : face * kRed);
      const auto found = meanOnFloor(solve);
      // Which looks pass is chance, 3 % of 400 leaves each; the colour is not.
      const auto part = found / truth;
      EXPECT_NEAR(part.x, 1.0, has_two ? 0.05 : 0.025) << angle;
      EXPECT_NEAR(part.y / part.x, 1.0, 0.001) << angle << ' ' << has_two << ": kept in 16 bits";
      EXPECT_NEAR(part.z / part.x, 1.0, 0.001) << angle << ' ' << has_two;
    }
  }
}

TEST_P(ColouredGlass, PassesOfLightFromAllAroundItsColour) {
  Solve solve(loadGlb(test_scenes::encodeGlb(floorBelow({glassOf(kRed, GetParam())}, true)), texelsOf(0.25)),
              settingsOf(0.005));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  constexpr int kSteps = 4000;
  double passes = 0.0;
  for (int i = 0; i < kSteps; ++i) passes += (1.0 - reflectanceAt(std::sqrt((i + 0.5) / kSteps))) / kSteps;
  const auto found = meanOnFloor(solve) / (std::numbers::pi * passes * kRed);
  for (int c = 0; c < 3; ++c)
    EXPECT_NEAR(found[c], 1.0, 0.0075) << c << ": the target of the solve, and what passes best in steps of 1/255";
}

TEST_P(ColouredGlass, ThatIsABulbColoursTheRoom) {
  const auto scene = roomWithBulb(glassOf(kRed, GetParam()));
  Solve solve(load(scene, 4000), settingsOf(0.01));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  EXPECT_LT(offFromPathTracer(solve, scene, 9, 16384), 0.025) << "stated: 0.01, and texels vary within";
}

INSTANTIATE_TEST_SUITE_P(Face, ColouredGlass, testing::Bool(),
                         [](const auto& info) { return info.param ? "OfTwoSides" : "OfOneSide"; });

/// A room that a sheet divides, with the lamp in one part of it; what is on the wall beyond.
TestScene dividedRoom(const Material& sheet, const Material& beyond, double reflectance) {
  TestScene scene;
  scene.name = "divided";
  const auto white = scene.add({"white", glm::dvec3(reflectance), {}});
  const auto light = scene.add({"light", glm::dvec3(0.0), glm::dvec3(100.0, 80.0, 60.0)});
  const auto pane = scene.add(sheet), wall = scene.add(beyond);
  Object room{"room", {}, {}}, divider{"divider", {}, {}}, lamp{"lamp", {}, {}};
  appendBox(room, {0, 0, 0}, {3, 1.5, 1.5}, {white, wall, white, white, white, white}, test_scenes::kNoFace, true);
  divider.polygons = {{{{1.6, 0, 0}, {1.6, 0, 1.5}, {1.6, 1.5, 1.5}, {1.6, 1.5, 0}}, pane}};
  appendBox(lamp, {0.5, 0.9, 0.6}, {0.7, 1.1, 0.8}, test_scenes::allFaces(light));
  scene.objects = {room, divider, lamp};
  return scene;
}

struct Division {
  const char* name;
  Material sheet, beyond;
  double reflectance = 0.6;
};
void PrintTo(const Division& division, std::ostream* to) { *to << division.name; }

Material metal(double roughness) {
  Material material{"metal", glm::dvec3(0.9), {}};
  material.metallic = 1.0;
  material.roughness = roughness;
  return material;
}
Material half(const glm::dvec3& colour) {
  auto material = glassOf(colour);
  material.transmission = 0.5;
  return material;
}

class DividedRoom : public testing::TestWithParam<Division> {};

// In white rooms the level of light hangs on what panes take at every passage.
TEST_P(DividedRoom, IsLitAsThePathTracerHasIt) {
  const auto& [name, sheet, beyond, reflectance] = GetParam();
  const auto scene = dividedRoom(sheet, beyond, reflectance);
  Solve solve(load(scene, 4000), settingsOf(0.01));
  EXPECT_TRUE(solve.run()) << "error " << solve.solver().error().total;
  expectSound(solve);
  EXPECT_LT(offFromPathTracer(solve, scene, 9, 16384), 0.025) << "stated: 0.01, and texels vary within";
}

INSTANTIATE_TEST_SUITE_P(By, DividedRoom,
                         testing::Values(Division{"red", glassOf(kRed), {"grey", glm::dvec3(0.5), {}}},
                                         Division{
                                             "blueAndWhite", glassOf(kBlue), {"white", glm::dvec3(0.85), {}}, 0.85},
                                         Division{"redBeforeAMirror", glassOf(kRed), metal(0.0)},
                                         Division{"blueBeforeBrushedMetal", glassOf(kBlue), metal(0.4)},
                                         Division{"halfRed", half(kRed), {"grey", glm::dvec3(0.5), {}}}),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace radiosity::accuracy
