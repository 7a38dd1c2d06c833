// Mirrors, metal and glass: closed forms, and the path tracer.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <numbers>
#include <string>
#include <utility>

#include "server/scene/shading/shade.h"
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

Material mirror(double roughness = 0.0, const glm::dvec3& colour = glm::dvec3(1.0)) {
  Material material{"mirror", colour, glm::dvec3(0.0)};
  material.metallic = 1.0;
  material.roughness = roughness;
  return material;
}

/// A closed room with a block of this in it.
TestScene furnaceWith(const Material& material) {
  auto scene = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0));
  scene.name = "furnace_with_mirror";
  const auto number = scene.add(material);
  Object block{"block", {}, {}};
  appendBox(block, {0.3, 0.3, 0.3}, {0.6, 0.7, 0.6}, test_scenes::allFaces(number));
  scene.objects.push_back(block);
  return scene;
}

class MirrorFurnace : public testing::TestWithParam<double> {};

// What sees the same light all around sees it in a white mirror, too, however rough that is: no light is lost.
TEST_P(MirrorFurnace, KeepsItsLightAroundAWhiteMirror) {
  Solve solve(load(furnaceWith(mirror(GetParam())), 2400), settingsOf(0.002));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  const auto off = compareToConstant(solve, 2.0 * std::numbers::pi);
  EXPECT_LT(std::abs(off.mean), 1e-4);
  EXPECT_LT(off.rms, 0.002);
  const auto energy = solve.solver().energy();
  EXPECT_NEAR(energy.specular[0] / energy.emitted[0], 0.0, 0.01) << "a white mirror keeps nothing";
}

INSTANTIATE_TEST_SUITE_P(Roughness, MirrorFurnace, testing::Values(0.0, 0.3, 0.7, 1.0),
                         [](const auto& info) { return std::to_string(std::lround(info.param * 10.0)); });

/// A lamp that is metal, as those are of which a file tells nothing but light; one behind bars that cut its leaves.
enum class LampKind { kSurface, kMetal, kBarred, kPoint, kSpot, kBall, kRectangle };

/// Hangs in one half of the box; `side`: 1, or -1 in the mirror image of that.
test_scenes::Light lightOf(LampKind kind, double side) {
  using Kind = test_scenes::Light::Kind;
  test_scenes::Light light;
  light.position = {side, 1.75, 1.0};
  light.intensity = glm::dvec3(10.0);
  if (kind == LampKind::kBall) light.radius_m = 0.1;
  if (kind == LampKind::kSpot || kind == LampKind::kRectangle) {
    light.kind = kind == LampKind::kSpot ? Kind::kSpot : Kind::kRectangle;
    light.target = {side * 0.2, 0.5, 0.9};  // at the mirror
    light.width_m = light.height_m = 0.4;
    light.outer_cone_rad = 0.9;
  }
  return light;
}

/// Right below a lamp of that half.
Object barsBelow(double side, std::uint32_t material) {
  Object bars{side > 0.0 ? "bars" : "other_bars", {}, {}};
  for (const double x : {0.8, 1.0, 1.2}) {
    const double low = side * x - 0.02, high = side * x + 0.02;
    appendBox(bars, {low, 1.78, 0.7}, {high, 1.795, 1.3}, test_scenes::allFaces(material));
  }
  return bars;
}

/// The half of a room that lies before a mirror, or all of it. A lamp hangs in each half.
TestScene box(bool is_doubled, LampKind kind) {
  TestScene scene;
  scene.name = is_doubled ? "doubled_box" : "mirrored_box";
  const auto white = scene.add({"white", glm::dvec3(0.7, 0.6, 0.5), {}});
  const auto red = scene.add({"red", glm::dvec3(0.7, 0.2, 0.2), {}});
  Material shining{"light", glm::dvec3(0.5), glm::dvec3(10.0)};
  if (kind == LampKind::kMetal) shining.metallic = 1.0;
  const auto light = scene.add(shining), glass = scene.add(mirror());
  Object room{"room", {}, {}};
  appendBox(room, {is_doubled ? -2.0 : 0.0, 0, 0}, {2, 2, 2},
            {is_doubled ? red : glass, red, white, white, white, white}, test_scenes::kNoFace, true);
  scene.objects = {room};
  for (const double side : {1.0, -1.0}) {
    if (side < 0.0 && !is_doubled) break;
    const auto name = side > 0.0 ? "lamp" : "other";
    if (kind == LampKind::kSurface || kind == LampKind::kMetal || kind == LampKind::kBarred) {
      scene.objects.push_back(test_scenes::makeCeilingLamp(name, {side, 1.8, 1.0}, 0.6, 0.6, white, light));
      if (kind == LampKind::kBarred) scene.objects.push_back(barsBelow(side, white));
    } else {
      scene.lights.push_back(lightOf(kind, side));
    }
  }
  return scene;
}

/// Texels of a size that divides the room, so that both boxes have the same.
Loaded loadBox(bool is_doubled, LampKind kind) {
  return loadGlb(test_scenes::encodeGlb(box(is_doubled, kind)), texelsOf(0.1));
}

class MirroredBox : public testing::TestWithParam<std::pair<std::string, LampKind>> {};

TEST_P(MirroredBox, IsLitAsTheDoubledBox) {
  const auto kind = GetParam().second;
  Solve mirrored(loadBox(false, kind), settingsOf(0.01)), doubled(loadBox(true, kind), settingsOf(0.005));
  EXPECT_TRUE(mirrored.run());
  EXPECT_TRUE(doubled.run());
  expectSound(mirrored);
  const auto others = wholeLeaves(doubled);
  double square = 0.0, all = 0.0, sum = 0.0, sum_other = 0.0;
  std::size_t matched = 0;
  for (const auto& leaf : wholeLeaves(mirrored)) {
    const auto& normal = leaf.footprint.pieces[0].normal;
    const auto other = std::ranges::find_if(others, [&](const LeafAt& at) {
      return glm::distance(at.middle, leaf.middle) < 0.01 && glm::dot(at.footprint.pieces[0].normal, normal) > 0.9;
    });
    if (other == others.end()) continue;  // the mirror itself
    const auto off = leaf.light - other->light;
    square += glm::dot(off, off);
    all += glm::dot(other->light, other->light);
    sum += leaf.light.x + leaf.light.y + leaf.light.z;
    sum_other += other->light.x + other->light.y + other->light.z;
    ++matched;
  }
  RecordProperty("matched", std::to_string(matched));
  RecordProperty("rms", std::to_string(std::sqrt(square / all)));
  RecordProperty("mean", std::to_string(sum / sum_other - 1.0));
  EXPECT_GT(matched, 1500U);
  EXPECT_NEAR(sum / sum_other, 1.0, 0.005);
  EXPECT_LT(std::sqrt(square / all), 0.02);
  EXPECT_EQ(mirrored.solver().spreadByMirrors(), 0.0) << "every lamp is seen in the mirror";
}

INSTANTIATE_TEST_SUITE_P(Lamp, MirroredBox,
                         testing::Values(std::pair("surface", LampKind::kSurface), std::pair("metal", LampKind::kMetal),
                                         std::pair("barred", LampKind::kBarred), std::pair("point", LampKind::kPoint),
                                         std::pair("spot", LampKind::kSpot), std::pair("ball", LampKind::kBall),
                                         std::pair("rectangle", LampKind::kRectangle)),
                         [](const auto& info) { return info.param.first; });

/// A black floor before a mirror two metres high, with the sun behind whoever looks into it.
TestScene floorBeforeMirror(const glm::dvec3& colour, double angle_deg) {
  TestScene scene;
  scene.name = "sun_in_mirror";
  const auto black = scene.add({"black", glm::dvec3(0.0), {}});
  const auto metal = scene.add(mirror(0.0, colour));
  Object floor{"floor", {}, {}}, wall{"wall", {}, {}};
  floor.polygons = {{{{0, 0, 4}, {6, 0, 4}, {6, 0, -4}, {0, 0, -4}}, black}};
  wall.polygons = {{{{0, 0, 4}, {0, 0, -4}, {0, 2, -4}, {0, 2, 4}}, metal}};
  scene.objects = {floor, wall};
  test_scenes::Light sun;
  sun.kind = test_scenes::Light::Kind::kDirectional;
  sun.target = {-1.0, -1.0, 0.0};
  sun.intensity = glm::dvec3(100.0);
  sun.angle_deg = angle_deg;
  scene.lights.push_back(sun);
  return scene;
}

// The sun's image lights the floor as far as the mirror reaches: two metres, at 45 degrees.
TEST(Mirrors, TheSunLightsTheFloorBeforeAMirrorTwice) {
  const glm::dvec3 gold(1.0, 0.75, 0.35);
  for (const double angle_deg : {0.0, 0.5}) {
    Solve solve(loadGlb(test_scenes::encodeGlb(floorBeforeMirror(gold, angle_deg)), texelsOf(0.125)),
                settingsOf(0.005));
    (void)solve.run();  // a black floor reflects nothing, so that there may be nothing left to refine
    const double once = 100.0 * std::sqrt(0.5), edge = std::pow(1.0 - std::sqrt(0.5), 5.0);
    std::size_t before = 0, beyond = 0;
    for (const auto& leaf : wholeLeaves(solve)) {
      if (leaf.middle.y > 0.01 || std::abs(leaf.middle.z) > 3.5) continue;
      const bool is_near = leaf.middle.x < 1.9;
      if (!is_near && leaf.middle.x < 2.1) continue;
      const auto twice = once * (1.0 + gold + (1.0 - gold) * edge);
      const auto truth = is_near ? twice : glm::dvec3(once);
      for (int c = 0; c < 3; ++c) ASSERT_NEAR(leaf.light[c], truth[c], 0.002 * truth[c]) << leaf.middle.x;
      ++(is_near ? before : beyond);
    }
    EXPECT_GT(before, 500U);
    EXPECT_GT(beyond, 500U);
    const auto energy = solve.solver().energy();
    EXPECT_LT(std::abs(energy.imbalance[0]) / energy.emitted[0], 0.01) << "what passes by the floor leaves";
  }
}

/// A room with this on one wall, and a block of it.
TestScene roomWith(const Material& material) {
  auto scene = litRoom();
  scene.name = "room_with_" + material.name;
  const auto number = scene.add(material);
  for (auto& polygon : scene.objects[0].polygons)
    if (std::ranges::all_of(polygon.corners, [](const auto& corner) { return corner.z < 0.01; }))
      polygon.material = number;
  for (auto& polygon : scene.objects[1].polygons) polygon.material = number;
  return scene;
}

class RoomWith : public testing::TestWithParam<std::pair<std::string, Material>> {};

TEST_P(RoomWith, IsLitAsThePathTracerHasIt) {
  const auto scene = roomWith(GetParam().second);
  Solve solve(load(scene, 4000), settingsOf(0.01));
  EXPECT_TRUE(solve.run()) << "error " << solve.solver().error().total;
  expectSound(solve);
  EXPECT_LT(offFromPathTracer(solve, scene, 9, 16384), 0.025);
}

INSTANTIATE_TEST_SUITE_P(Metal, RoomWith,
                         testing::Values(std::pair("mirror", mirror(0.0, glm::dvec3(0.95))),
                                         std::pair("gold", mirror(0.4, {1.0, 0.75, 0.35})),
                                         std::pair("iron", mirror(0.6, glm::dvec3(0.55)))),
                         [](const auto& info) { return info.param.first; });

// A roughness that changes sends only those rays anew that met it, and the light is that of a solve from nothing.
TEST(Mirrors, AnEditOfRoughnessCastsOnlyRaysThatMetIt) {
  const auto smooth = load(roomWith(mirror(0.1)), 2000), rough = load(roomWith(mirror(0.6)), 2000);
  Solve edited(smooth, settingsOf(0.02)), anew(rough, settingsOf(0.02));
  EXPECT_TRUE(edited.run());
  EXPECT_TRUE(anew.run());
  const auto before = edited.solver().irradiance();
  EXPECT_TRUE(edited.edit(rough.materials));
  double square = 0.0, all = 0.0;
  const auto of_anew = anew.solver().irradiance();
  edited.eachLeaf([&](std::uint32_t node, double area, const glm::dvec3& h) {
    const auto off = h - glm::dvec3(of_anew[node]);
    square += area * glm::dot(off, off);
    all += area * glm::dot(h, h);
  });
  EXPECT_LT(std::sqrt(square / all), 0.03);
  EXPECT_TRUE(edited.edit(smooth.materials));
  EXPECT_EQ(edited.solver().irradiance(), before) << "what came back is what was";
}

Material clearGlass(bool is_double_sided) { return glassOf(glm::dvec3(1.0), is_double_sided); }

// Clear glass passes what it does not reflect: what sees the same light all around sees it in and through glass, too.
class Glass : public testing::TestWithParam<bool> {};

TEST_P(Glass, ThatIsClearLeavesAFurnaceAsItIs) {
  Solve solve(load(furnaceWith(clearGlass(GetParam())), 2400), settingsOf(0.005));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  EXPECT_LT(std::abs(compareToConstant(solve, 2.0 * std::numbers::pi).mean), 0.002) << "half the target of the solve";
}

TEST_P(Glass, PassesOfLightFromAllAroundWhatFresnelLeaves) {
  Solve solve(loadGlb(test_scenes::encodeGlb(floorBelow({clearGlass(GetParam())}, true)), texelsOf(0.25)),
              settingsOf(0.005));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  constexpr int kSteps = 4000;
  double passes = 0.0;
  for (int i = 0; i < kSteps; ++i) passes += (1.0 - reflectanceAt(std::sqrt((i + 0.5) / kSteps))) / kSteps;
  EXPECT_NEAR(meanOnFloor(solve).x / (std::numbers::pi * passes), 1.0, 0.005) << "the target of the solve";
}

TEST_P(Glass, PassesOfLightFromFarAwayWhatFresnelLeavesAtItsAngle) {
  for (const double angle : {0.0, 1.2}) {
    auto scene = floorBelow({clearGlass(GetParam())}, false);
    test_scenes::Light sun;
    sun.kind = test_scenes::Light::Kind::kDirectional;
    sun.target = {std::sin(angle), -std::cos(angle), 0.0};
    sun.intensity = glm::dvec3(100.0);
    scene.lights.push_back(sun);
    Solve solve(loadGlb(test_scenes::encodeGlb(scene), texelsOf(0.25)), settingsOf(0.005));
    (void)solve.run();  // a black floor reflects nothing, so that there may be nothing left to refine
    const double cosine = std::cos(angle), truth = 100.0 * cosine * (1.0 - reflectanceAt(cosine));
    EXPECT_NEAR(meanOnFloor(solve).x / truth, 1.0, 0.015) << angle << ": 150 leaves, by chance each time they look";
  }
}

TEST_P(Glass, ThatIsABulbLetsItsLampLightTheRoom) {
  const auto scene = roomWithBulb(clearGlass(GetParam()));
  Solve solve(load(scene, 4000), settingsOf(0.01));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  EXPECT_LT(offFromPathTracer(solve, scene, 9, 16384), 0.025) << "stated: 0.01, and texels vary within";
}

INSTANTIATE_TEST_SUITE_P(Face, Glass, testing::Bool(),
                         [](const auto& info) { return info.param ? "OfTwoSides" : "OfOneSide"; });

/// With a lamp without size and a white mirror, of this shape.
TestScene pointAndMirror(const std::function<void(Object&, std::uint32_t)>& appendMirror) {
  TestScene scene;
  scene.name = "point_and_mirror";
  const auto grey = scene.add({"grey", glm::dvec3(0.5), {}});
  const auto white = scene.add(mirror());
  Object room{"room", {}, {}}, block{"block", {}, {}};
  appendBox(room, {0, 0, 0}, {2, 2, 2}, test_scenes::allFaces(grey), test_scenes::kNoFace, true);
  appendMirror(block, white);
  scene.objects = {room, block};
  test_scenes::Light lamp;
  lamp.position = {1.3, 1.6, 1.0};
  lamp.intensity = glm::dvec3(100.0);
  scene.lights.push_back(lamp);
  return scene;
}

/// Nothing leaves the room, and a white mirror keeps nothing: all is absorbed by the walls. Returns the part of the
/// light that mirrors spread.
double spreadOf(const TestScene& scene) {
  Solve solve(load(scene, 4000), settingsOf(0.01));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  const auto energy = solve.solver().energy();
  EXPECT_NEAR(energy.absorbed[0] / energy.emitted[0], 1.0, 0.01);
  return solve.solver().spreadByMirrors() / (3.0 * energy.emitted[0]);
}

// Rays do not meet a lamp without size in mirrors, and round ones have no image: what they reflect of it leaves them
// all the same.
TEST(Mirrors, LightOfALampWithoutSizeIsNotLost) {
  const auto ball = [](Object& object, std::uint32_t white) {
    appendSphere(object, {0.7, 0.7, 0.8}, 0.4, 2, white, false);
  };
  EXPECT_GT(spreadOf(pointAndMirror(ball)), 0.03) << "this scene is to test something";
}

// Of a block each face has an image, and none is seen in another.
TEST(Mirrors, FacesOfABlockShowALampWithoutSize) {
  const auto block = [](Object& object, std::uint32_t white) {
    appendBox(object, {0.4, 0.3, 0.4}, {1.0, 1.0, 1.2}, test_scenes::allFaces(white));
  };
  EXPECT_EQ(spreadOf(pointAndMirror(block)), 0.0);
}

// What comes from one mirror to another is spread there.
TEST(Mirrors, FacingEachOtherLoseNoLightOfALampWithoutSize) {
  const auto pair = [](Object& object, std::uint32_t white) {
    appendBox(object, {0.4, 0.3, 0.4}, {0.5, 1.5, 1.6}, test_scenes::allFaces(white));
    appendBox(object, {1.7, 0.3, 0.4}, {1.8, 1.5, 1.6}, test_scenes::allFaces(white));
  };
  const double spread = spreadOf(pointAndMirror(pair));
  EXPECT_GT(spread, 0.01);
  EXPECT_LT(spread, 0.2) << "most of the light comes by way of one mirror alone";
}

}  // namespace
}  // namespace radiosity::accuracy
