// Scenes with next to nothing in them: a sensible answer, at once.
#include <gtest/gtest.h>

#include <numbers>

#include "tests/accuracy/stress/stress_solve.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"
#include "tests/unit/scene/gltf_builder.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::TestScene;

constexpr std::uint64_t kFewTexels = 400;
/// Instant: no more images than the samples of one lamp.
constexpr std::uint64_t kFewShots = 300;

TestScene floorOf(glm::dvec3 reflectance, glm::dvec3 emission_nits) {
  TestScene scene;
  scene.name = "floor";
  const auto material = scene.add({"floor", reflectance, emission_nits});
  scene.objects.push_back({"floor", {}, {{{{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}}, material}}});
  return scene;
}

void expectDark(const Solve& solve) {
  solve.eachLeaf([](std::uint32_t, double, const glm::dvec3& h) { ASSERT_EQ(h, glm::dvec3(0.0)); });
}

TEST(Trivial, NoPolygonIsDoneAtOnce) {
  Solve solve(loadGlb(scene::test::GltfBuilder().glb(), {}));
  EXPECT_TRUE(solve.run(2));
  EXPECT_EQ(solve.solver().shots(), 0U);
  EXPECT_EQ(solve.solver().error().total, 0.0);
}

TEST(Trivial, OnePolygonWithoutLightIsDarkAtOnce) {
  Solve solve(load(floorOf(glm::dvec3(0.5), glm::dvec3(0.0)), kFewTexels));
  EXPECT_TRUE(solve.run(2));
  EXPECT_EQ(solve.solver().shots(), 0U);
  EXPECT_EQ(solve.solver().error().total, 0.0);
  expectDark(solve);
}

TEST(Trivial, OnePolygonThatShinesSendsItAllAway) {
  Solve solve(load(floorOf(glm::dvec3(0.5), glm::dvec3(2.0)), kFewTexels));
  EXPECT_TRUE(solve.run(100));
  EXPECT_LT(solve.solver().shots(), kFewShots);
  expectDark(solve);
  expectSound(solve);
  const auto e = solve.solver().energy();
  EXPECT_GT(e.emitted[0], 0.0);
  EXPECT_NEAR(e.escaped[0] / e.emitted[0], 1.0, 1e-6);
}

TEST(Trivial, ARoomWithoutLightIsDarkAtOnce) {
  Solve solve(load(test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(0.0)), kFewTexels));
  EXPECT_TRUE(solve.run(2));
  EXPECT_EQ(solve.solver().shots(), 0U);
  expectDark(solve);
}

TEST(Trivial, ABlackRoomHasDirectLightOnly) {
  auto scene = litRoom();
  for (auto& material : scene.materials) material.reflectance = glm::dvec3(0.0);
  Solve solve(load(scene, kFewTexels));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  EXPECT_EQ(solve.solver().plannerCounters().shooters, 0U) << "black never shoots";
  const auto e = solve.solver().energy();
  EXPECT_NEAR(e.absorbed[0] / e.emitted[0], 1.0, 0.02);
}

TEST(Trivial, ARoomInWhichAllShinesAndNothingReflectsIsItsOwnEmission) {
  Solve solve(load(test_scenes::furnace(glm::dvec3(0.0), glm::dvec3(3.0)), kFewTexels));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  EXPECT_LT(std::abs(compareToConstant(solve, 3.0 * std::numbers::pi).mean), 1e-4);
}

TEST(Trivial, ALampOutsideAClosedRoomLeavesItDark) {
  auto scene = litRoom();
  for (auto& material : scene.materials) material.emission_nits = glm::dvec3(0.0);
  const auto light = scene.add({"outside", glm::dvec3(0.5), glm::dvec3(1000.0)});
  test_scenes::Object lamp{"outside", {}, {}};
  appendBox(lamp, {5.0, 0.0, 0.0}, {5.5, 0.5, 0.5}, test_scenes::allFaces(light));
  scene.objects.push_back(lamp);
  scene.lights.push_back({.position = {-3.0, 1.0, 1.0}, .intensity = glm::dvec3(500.0)});
  Solve solve(load(scene, kFewTexels));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  EXPECT_LT(solve.solver().shots(), kFewShots);
  const auto& patches = solve.patches();
  const auto arrives = solve.solver().irradiance();
  for (const auto& surface : patches.surfaces) {
    const auto middle = 0.5F * (surface.bounds_min + surface.bounds_max);
    const double x = static_cast<double>(middle.x) * patches.scale + patches.centre.x;
    if (x > 3.0) continue;  // the lamp itself
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      ASSERT_EQ(arrives[surface.first_node[0] + leaf], glm::vec3(0.0F)) << "light leaks in";
    }
  }
  const auto e = solve.solver().energy();
  EXPECT_GT(e.emitted[0], 0.0);
  EXPECT_NEAR((e.escaped[0] + e.backface[0]) / e.emitted[0], 1.0, 0.01);
}

}  // namespace
}  // namespace radiosity::accuracy
