// Edits of lights and of the sky are solved on from where the solve was; the geometry is not touched.
#include <gmock/gmock.h>

#include <algorithm>
#include <glm/geometric.hpp>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::SolveState;

/// A closed grey cube of side 1 with a point light in it.
test_scenes::TestScene lampRoom(double candela) {
  auto scene = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(0.0));
  scene.lights.push_back({.position = {0.6, 0.7, 0.5}, .intensity = glm::dvec3(candela)});
  return scene;
}

class Lights : public EngineTest {
 protected:
  void SetUp() override {
    EngineTest::SetUp();
    ASSERT_TRUE(configure([](auto& settings) { settings.target_error = 0.03; }));
  }
  double mean() {
    (void)sceneText();  // the final lightmaps are published after the state

    const auto shown = engine().lightmaps();
    return shown ? meanIrradiance(*shown) : 0.0;
  }
  bool saysNothingShines() {
    const auto warnings = status().warnings;
    return std::ranges::any_of(warnings, [](const auto& w) { return w.find("nothing shines") != std::string::npos; });
  }
};

TEST_F(Lights, APatchOfTheIntensitySolvesOnlyTheLightAgain) {
  solve(lampRoom(10.0));
  const double before = mean();
  EXPECT_GT(before, 0.0);
  const auto layout = engine().lightmaps()->layout;
  const auto outcome =
      patch(R"([{"op": "replace", "path": "/extensions/KHR_lights_punctual/lights/0/intensity", "value": 5}])");
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_GT(outcome->affected_surfaces, 0U);
  EXPECT_EQ(outcome->affected_shots, 0U) << "nothing was thrown away";
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_EQ(engine().lightmaps()->layout, layout);
  EXPECT_NEAR(mean() / before, 0.5, 0.02);  // within the target error of these solves
}

TEST_F(Lights, MovingTheNodeOfALightMovesOnlyTheLight) {
  solve(lampRoom(10.0));
  const double before = mean();
  const auto layout = engine().lightmaps()->layout;
  const auto outcome = patch(R"([{"op": "replace", "path": "/nodes/@light0/translation", "value": [0.3, 0.4, 0.6]}])");
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->affected_shots, 0U);
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_EQ(engine().lightmaps()->layout, layout);
  EXPECT_NEAR(mean() / before, 1.0, 0.06);  // a closed room receives all of it wherever it is
}

TEST_F(Lights, MovingANodeWithAMeshBelowItIsAnEditOfGeometry) {
  solve(lampRoom(10.0));
  const auto outcome = patch(R"([{"op": "replace", "path": "/nodes/0/translation", "value": [0.1, 0, 0]}])");
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_GT(outcome->affected_shots, 0U);
}

TEST_F(Lights, TheSettingServesScenesWithoutASkyOfTheirOwnAndAPatchGivesThemOne) {
  auto open = test_scenes::parallelPlates(1.0, 1.0, 5.0, 0.0, 0.0);
  ASSERT_TRUE(load(open));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_TRUE(saysNothingShines());
  EXPECT_EQ(mean(), 0.0);
  ASSERT_TRUE(configure([](auto& settings) { settings.sky = {glm::vec3(1.0F), glm::vec3(1.0F)}; }));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_FALSE(saysNothingShines());
  const double by_setting = mean();
  EXPECT_GT(by_setting, 0.0);
  ASSERT_TRUE(patch(R"([{"op": "add", "path": "/extras", "value": {"radiositySky": {"upper": [3, 3, 3]}}}])"));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_NEAR(mean() / by_setting, 3.0, 0.3);
}

TEST_F(Lights, ASkyThatIsNoneIsRefusedAtItsPointer) {
  solve(lampRoom(10.0));
  const auto outcome = patch(R"([{"op": "add", "path": "/extras", "value": {"radiositySky": {"upper": [1, -2, 3]}}}])");
  ASSERT_FALSE(outcome);
  EXPECT_EQ(outcome.error().code, ErrorCode::kInvalidScene);
  EXPECT_THAT(outcome.error().where, testing::HasSubstr("/extras/radiositySky/upper"));
}

}  // namespace
}  // namespace radiosity::test
