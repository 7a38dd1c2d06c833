// What shines is never lost, or it is said which lamp is, and why; rooms that are turned inside out are told of.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::SolveState;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

constexpr std::uint32_t kWall = 0, kGlow = 1, kBody = 2;

/// A closed grey room of side 2, without a lamp.
test_scenes::TestScene room(bool inwards = true) {
  test_scenes::TestScene scene;
  scene.name = "room";
  scene.add({"wall", glm::dvec3(0.5), glm::dvec3(0.0)});
  scene.add({"glow", glm::dvec3(0.0), glm::dvec3(100.0)});
  scene.add({"body", glm::dvec3(0.3), glm::dvec3(0.0)});
  test_scenes::Object walls{"walls", {}, {}};
  test_scenes::appendBox(walls, {0, 0, 0}, {2, 2, 2}, test_scenes::allFaces(kWall), test_scenes::kNoFace, inwards);
  scene.objects.push_back(std::move(walls));
  scene.camera = {{1, 1, 1.9}, {1, 1, 0}, 1.2, 1.0};
  return scene;
}

/// Half a metre square at height y, facing down, or up.
test_scenes::Object panel(const std::string& name, double y, bool up = false, std::uint32_t material = kGlow) {
  test_scenes::Object object{name, {}, {}};
  std::vector<glm::dvec3> corners = {{0.75, y, 0.75}, {1.25, y, 0.75}, {1.25, y, 1.25}, {0.75, y, 1.25}};
  if (up) std::ranges::reverse(corners);
  object.polygons.push_back({std::move(corners), material});
  return object;
}

test_scenes::TestScene with(test_scenes::TestScene scene, test_scenes::Object object) {
  scene.objects.push_back(std::move(object));
  return scene;
}

class LostLight : public EngineTest {
 protected:
  void SetUp() override {
    EngineTest::SetUp();
    ASSERT_TRUE(configure([](auto& settings) { settings.target_error = 0.03, settings.texels = 600; }));
  }
  double mean() {
    (void)sceneText();  // the final lightmaps are published after the state
    const auto shown = engine().lightmaps();
    return shown ? meanIrradiance(*shown) : 0.0;
  }
  /// Of a scene that is solved.
  std::vector<std::string> warningsOf(const test_scenes::TestScene& scene) {
    solve(scene);
    (void)sceneText();
    return status().warnings;
  }
};

TEST_F(LostLight, ALampInThePlaneOfTheCeilingLightsTheRoomAsOneRightBelowIt) {
  solve(with(room(), panel("lamp", 2.0)));
  const auto in_plane = mean();
  EXPECT_EQ(status().unlit, "");
  solve(with(room(), panel("lamp", 2.0 - 1e-4)));
  EXPECT_NEAR(in_plane / mean(), 1.0, 0.03);  // the target error of each
}

// The order of what is seen changes with it, so the solve after the edit must be that of the edited scene.
TEST_F(LostLight, SwitchingALampThatLiesOnAnotherFaceEndsAsASceneThatIsLoadedSo) {
  auto scene = with(room(), panel("lamp", 2.0));
  const auto spare = scene.add({"spare", glm::dvec3(0.0), glm::dvec3(50.0)});
  scene.objects.push_back(panel("second", 0.5, true, spare));
  solve(scene);
  const auto both = mean();
  const auto off = patch(emissionPatch(kGlow, 0.0));
  ASSERT_TRUE(off) << off.error().text();
  EXPECT_GT(off->affected_shots, 0U) << "the ceiling is seen there now: links are measured again";
  ASSERT_TRUE(reaches(SolveState::kConverged));
  const auto one = mean();
  scene.materials[kGlow].emission_nits = glm::dvec3(0.0);
  solve(scene);
  EXPECT_NEAR(one / mean(), 1.0, 0.05);  // twice the target error, and some
  EXPECT_LT(one, 0.8 * both);
  ASSERT_TRUE(patch(emissionPatch(kGlow, 100.0)));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_NEAR(mean() / both, 1.0, 0.05);
  EXPECT_EQ(status().unlit, "");
}

TEST_F(LostLight, SwitchingALampThatLiesOnNothingIsNoEditOfGeometry) {
  solve(with(room(), panel("lamp", 1.5)));
  const auto off = patch(emissionPatch(kGlow, 0.0));
  ASSERT_TRUE(off);
  EXPECT_EQ(off->affected_shots, 0U);
}

TEST_F(LostLight, ABuriedLampIsNamedAndNoErrorIsStatedForABlackScene) {
  auto scene = with(room(), panel("lamp", 1.0));
  test_scenes::Object block{"block", {}, {}};
  test_scenes::appendBox(block, {0.5, 0.5, 0.5}, {1.5, 1.5, 1.5}, test_scenes::allFaces(kBody));
  const auto warnings = warningsOf(with(std::move(scene), std::move(block)));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("'lamp'"), HasSubstr("'glow'"), HasSubstr("inside a closed solid"))));
  EXPECT_THAT(warnings, Not(Contains(HasSubstr("no emissive surface"))));
  EXPECT_THAT(status().unlit, HasSubstr("lamp shines with nothing"));
}

TEST_F(LostLight, ALampUnderAnotherLampIsNamedAndTheSceneIsLit) {
  auto scene = with(room(), panel("first", 1.5));
  const auto other = scene.add({"other", glm::dvec3(0.0), glm::dvec3(30.0)});
  const auto warnings = warningsOf(with(std::move(scene), panel("second", 1.5, false, other)));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("lamp /nodes/2 'second'"), HasSubstr("lies under /nodes/1 'first'"))));
  EXPECT_EQ(status().unlit, "");
  EXPECT_GT(mean(), 0.0);
}

TEST_F(LostLight, ALampThatFacesAwayIsNamed) {
  auto scene = with(room(), panel("lamp", 1.5));
  const auto warnings = warningsOf(with(std::move(scene), panel("turned", 2.5, true)));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("'turned'"), HasSubstr("lights nothing"), HasSubstr("the void"))));
  EXPECT_THAT(warnings, Not(Contains(HasSubstr("'lamp'"))));
  EXPECT_EQ(status().unlit, "");
}

TEST_F(LostLight, WhereAllLightLeavesTheSceneThatIsSaid) {
  test_scenes::TestScene scene;
  scene.name = "void";
  scene.add({"wall", glm::dvec3(0.5), glm::dvec3(0.0)});
  scene.add({"glow", glm::dvec3(0.0), glm::dvec3(100.0)});
  const auto warnings = warningsOf(with(std::move(scene), panel("lamp", 1.0)));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("'lamp'"), HasSubstr("the void"))));
  EXPECT_EQ(status().unlit, "all of it leaves the scene");
}

TEST_F(LostLight, WhereAllIsMetalLightArrives) {
  auto scene = room();
  for (auto& material : scene.materials) material.metallic = 1.0;
  (void)warningsOf(with(std::move(scene), panel("lamp", 1.5)));
  EXPECT_EQ(status().unlit, "");
}

TEST_F(LostLight, APointLightInsideASolidIsNamed) {
  auto scene = with(room(), panel("lamp", 1.9));
  test_scenes::Object block{"block", {}, {}};
  test_scenes::appendBox(block, {0.5, 0.2, 0.5}, {1.5, 1.2, 1.5}, test_scenes::allFaces(kBody));
  scene.objects.push_back(std::move(block));
  scene.lights.push_back({.position = {1.0, 0.7, 1.0}, .intensity = glm::dvec3(5.0)});
  scene.lights.push_back({.position = {0.2, 1.7, 0.2}, .intensity = glm::dvec3(5.0)});
  const auto warnings = warningsOf(scene);
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("'light0'"), HasSubstr("lights nothing"), HasSubstr("'block'"))));
  EXPECT_THAT(warnings, Not(Contains(HasSubstr("'light1'"))));
}

TEST_F(LostLight, OfManyLostLampsSomeAreNamedAndTheOthersCounted) {
  auto scene = with(room(), panel("lamp", 1.5));
  test_scenes::Object block{"block", {}, {}};
  test_scenes::appendBox(block, {0.5, 0.2, 0.5}, {1.5, 1.2, 1.5}, test_scenes::allFaces(kBody));
  scene.objects.push_back(std::move(block));
  for (int i = 0; i < 23; ++i) scene.objects.push_back(panel("lost" + std::to_string(i), 0.3 + 0.03 * i));
  const auto warnings = warningsOf(scene);
  EXPECT_EQ(std::ranges::count_if(warnings, [](const auto& w) { return w.find("inside a closed solid") != w.npos; }),
            20);
  EXPECT_THAT(warnings, Contains("3 more lamps shine with nothing"));
}

// The lamp hangs a little above a floor that faces down.
TEST_F(LostLight, LightThatEndsOnBacksIsToldOfWithWhatHelps) {
  test_scenes::TestScene scene;
  scene.name = "turned";
  scene.add({"wall", glm::dvec3(0.5), glm::dvec3(0.0)});
  scene.add({"glow", glm::dvec3(0.0), glm::dvec3(100.0)});
  scene.objects = {panel("floor", 0.0, false, kWall), panel("lamp", 0.2)};
  const auto warnings = warningsOf(scene);
  EXPECT_THAT(warnings,
              Contains(AllOf(HasSubstr("% of the light ends on backs of single-sided faces: /nodes/0 'floor', "
                                       "material 'wall' (100 % of it)"),
                             HasSubstr("--double-sided"))));
  EXPECT_THAT(warnings, Contains(AllOf(HasSubstr("'lamp'"), HasSubstr("lights nothing"))));
  EXPECT_NE(status().unlit, "");
}

TEST_F(LostLight, WithBothSidesLitARoomCostsHardlyMorePatches) {
  ASSERT_TRUE(configure([](auto& settings) { settings.double_sided = true; }));
  solve(with(room(), panel("lamp", 1.5)));
  EXPECT_TRUE(status().settings.double_sided);
  const auto nodes = status().nodes;
  ASSERT_TRUE(configure([](auto& settings) { settings.double_sided = false; }));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_FALSE(status().settings.double_sided);
  // The outside of the room, which no light reaches, has none; the lamp, which shines on both sides, has some on both.
  EXPECT_LT(static_cast<double>(nodes), 1.3 * static_cast<double>(status().nodes));
}

TEST_F(LostLight, ARoomWhoseLightArrivesIsToldNothing) {
  const auto warnings = warningsOf(with(room(), panel("lamp", 1.5)));
  EXPECT_THAT(warnings, Not(Contains(HasSubstr("lights nothing"))));
  EXPECT_THAT(warnings, Not(Contains(HasSubstr("backs"))));
}

// The setting holds for what comes later, too, and edits of light stay edits of light.
TEST_F(LostLight, WithBothSidesLitAnEditOfLightIsStillOne) {
  ASSERT_TRUE(configure([](auto& settings) { settings.double_sided = true; }));
  solve(with(room(), panel("lamp", 1.5)));
  const auto outcome = patch(emissionPatch(kGlow, 50.0));
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->affected_shots, 0U);
}

}  // namespace
}  // namespace radiosity::test
