// Coloured glass: closed forms, and the path tracer, which carries each channel by itself.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

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

Material tinted(const glm::dvec3& colour, bool is_double_sided = true) {
  Material material{"tinted", colour, {}};
  material.transmission = 1.0;
  material.roughness = 0.0;
  material.double_sided = is_double_sided;
  return material;
}

/// Of an index of 1.5, as told without the code under test.
double reflectanceAt(double cosine) { return 0.04 + 0.96 * std::pow(1.0 - cosine, 5.0); }

/// A black floor below panes as wide, each a hand above the last, in a room whose walls shine with one nit, or under
/// the sky alone.
TestScene floorBelow(const std::vector<Material>& panes, bool has_walls) {
  TestScene scene;
  scene.name = "floor_below_colours";
  const auto black = scene.add({"black", glm::dvec3(0.0), {}});
  const auto shines = scene.add({"shines", glm::dvec3(0.0), glm::dvec3(1.0)});
  const auto square = [](double y) {
    return std::vector<glm::dvec3>{{-2.5, y, 2.5}, {2.5, y, 2.5}, {2.5, y, -2.5}, {-2.5, y, -2.5}};
  };
  Object room{"room", {}, {}}, floor{"floor", {}, {}};
  appendBox(room, glm::dvec3(-3.0), glm::dvec3(3.0), test_scenes::allFaces(shines), test_scenes::kNoFace, true);
  floor.polygons = {{square(0.0), black}};
  if (has_walls) scene.objects.push_back(room);
  scene.objects.push_back(floor);
  double height = 0.0;
  for (const auto& pane : panes) {
    Object sheet{"pane", {}, {}};
    sheet.polygons = {{square(height += 0.02), scene.add(pane)}};
    scene.objects.push_back(sheet);
  }
  return scene;
}

/// Of the floor far from its edges.
glm::dvec3 meanOnFloor(const Solve& solve) {
  glm::dvec3 sum(0.0);
  std::size_t count = 0;
  for (const auto& leaf : wholeLeaves(solve)) {
    if (std::max(std::abs(leaf.middle.x), std::abs(leaf.middle.z)) > 1.5 || std::abs(leaf.middle.y) > 0.01) continue;
    sum += leaf.light;
    ++count;
  }
  EXPECT_GT(count, 50U);
  return sum / static_cast<double>(count);
}

class ColouredGlass : public testing::TestWithParam<bool> {};

TEST_P(ColouredGlass, PassesOfTheSunItsColour) {
  for (const double angle : {0.0, 1.2}) {
    for (const bool has_two : {false, true}) {
      std::vector panes{tinted(kRed, GetParam())};
      if (has_two) panes.push_back(tinted(kBlue, GetParam()));
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
  Solve solve(loadGlb(test_scenes::encodeGlb(floorBelow({tinted(kRed, GetParam())}, true)), texelsOf(0.25)),
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

/// A lamp in a bulb of coloured glass, in a closed room.
TestScene roomWithBulb(const Material& material) {
  TestScene scene;
  scene.name = "coloured_bulb";
  const auto white = scene.add({"white", glm::dvec3(0.7), {}});
  const auto light = scene.add({"light", glm::dvec3(0.0), glm::dvec3(20.0)});
  const auto clear = scene.add(material);
  Object room{"room", {}, {}}, bulb{"bulb", {}, {}}, lamp{"lamp", {}, {}};
  appendBox(room, {0, 0, 0}, {2, 2, 2}, test_scenes::allFaces(white), test_scenes::kNoFace, true);
  appendSphere(bulb, {1.0, 1.2, 1.0}, 0.3, 2, clear, false);
  appendBox(lamp, {0.9, 1.1, 0.9}, {1.1, 1.3, 1.1}, test_scenes::allFaces(light));
  scene.objects = {room, bulb, lamp};
  return scene;
}

TEST_P(ColouredGlass, ThatIsABulbColoursTheRoom) {
  const auto scene = roomWithBulb(tinted(kRed, GetParam()));
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
  auto material = tinted(colour);
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
                         testing::Values(Division{"red", tinted(kRed), {"grey", glm::dvec3(0.5), {}}},
                                         Division{"blueAndWhite", tinted(kBlue), {"white", glm::dvec3(0.85), {}}, 0.85},
                                         Division{"redBeforeAMirror", tinted(kRed), metal(0.0)},
                                         Division{"blueBeforeBrushedMetal", tinted(kBlue), metal(0.4)},
                                         Division{"halfRed", half(kRed), {"grey", glm::dvec3(0.5), {}}}),
                         [](const auto& info) { return std::string(info.param.name); });

}  // namespace
}  // namespace radiosity::accuracy
