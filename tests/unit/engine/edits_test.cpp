// Edits are whole or not at all, and only what they touch is solved again.
#include <gmock/gmock.h>

#include <algorithm>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::SolveState;
using test_scenes::lumpedCube;

constexpr double kPi = 3.14159265358979;

class Edits : public EngineTest {
 protected:
  void expectRefused(const std::string& json, ErrorCode code) {
    const auto text = sceneText();
    const auto before = status();
    recorder_->forget();
    const auto outcome = patch(json);
    ASSERT_FALSE(outcome) << json;
    EXPECT_EQ(outcome.error().code, code) << outcome.error().text();
    EXPECT_EQ(sceneText(), text);
    EXPECT_EQ(status().revision, before.revision);
    EXPECT_TRUE(recorder_->patched().empty());
  }

  std::size_t clampWarnings() {
    const auto warnings = status().warnings;
    return static_cast<std::size_t>(std::ranges::count_if(
        warnings, [](const auto& warning) { return warning.find("reflectance above") != std::string::npos; }));
  }
};

TEST_F(Edits, AnEditOnAStaleRevisionIsRefused) {
  solve(lumpedCube(0.5));
  ASSERT_TRUE(patch(emissionPatch(1, 1.0)));
  const auto text = sceneText();
  const auto late = patch({emissionPatch(1, 5.0), 1, false, "late"});
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, ErrorCode::kStaleRevision);
  EXPECT_EQ(sceneText(), text);
}

TEST_F(Edits, OfTwoWritersOnOneRevisionExactlyOneWins) {
  solve(lumpedCube(0.5));
  std::promise<Result<engine::PatchOutcome>> first, second;
  engine().patch({emissionPatch(1, 2.0), 1, false, "a"}, [&](auto outcome) { first.set_value(std::move(outcome)); });
  engine().patch({emissionPatch(1, 3.0), 1, false, "b"}, [&](auto outcome) { second.set_value(std::move(outcome)); });
  EXPECT_EQ(first.get_future().get().value().revision, 2U);
  EXPECT_EQ(second.get_future().get().error().code, ErrorCode::kStaleRevision);
  ASSERT_EQ(recorder_->patched().size(), 1U);
  EXPECT_EQ(recorder_->patched()[0].by, "a");
}

TEST_F(Edits, AFailedTestChangesNothing) {
  solve(lumpedCube(0.5));
  expectRefused(R"([{"op":"replace","path":"/materials/1/emissiveFactor","value":[0,0,0]},
                    {"op":"test","path":"/materials/0/name","value":"another"}])",
                ErrorCode::kTestFailed);
  EXPECT_EQ(status().state, SolveState::kConverged);
}

TEST_F(Edits, AnInvalidSceneLeavesSceneAndSolveGoing) {
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kNever; }));
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(eventually([&] { return status().shots > 0; }));
  const auto before = status();
  expectRefused(R"([{"op":"replace","path":"/nodes/0/mesh","value":99}])", ErrorCode::kInvalidScene);
  expectRefused(R"([{"op":"replace","path":"/nodes/0/translation","value":[0,"up",0]}])", ErrorCode::kInvalidScene);
  for (const char* path : {"/materials/0", "/nodes/0", "/materials/0/extensions"}) {  // compared before it is checked
    expectRefused(std::string(R"([{"op":"replace","path":")") + path + R"(","value":5}])", ErrorCode::kInvalidScene);
  }
  expectRefused("no json", ErrorCode::kBadInput);
  EXPECT_EQ(status().state, SolveState::kSolving);
  EXPECT_GE(status().shots, before.shots);  // it did not start over
  EXPECT_TRUE(eventually([&] { return status().shots > before.shots; }));
}

TEST_F(Edits, ADryRunChecksAndChangesNothing) {
  solve(lumpedCube(0.5));
  const auto text = sceneText();
  recorder_->forget();
  const auto outcome = patch({emissionPatch(1, 9.0), 1, true, "dry"});
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->revision, 1U);
  EXPECT_EQ(sceneText(), text);
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_TRUE(recorder_->patched().empty());
  EXPECT_EQ(patch({R"([{"op":"replace","path":"/nodes/0/mesh","value":99}])", {}, true, "dry"}).error().code,
            ErrorCode::kInvalidScene);
}

TEST_F(Edits, ABrighterLampKeepsTheLayoutAndScalesTheLight) {
  solve(lumpedCube(0.5));
  const auto before = engine().lightmaps();
  const auto uploads = script_->uploads.load();
  const auto outcome = patch({emissionPatch(1, 2.0 / kPi), 1, false, "ann"});
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->revision, 2U);
  EXPECT_EQ(outcome->affected_surfaces, 1U);
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  const auto after = engine().lightmaps();
  EXPECT_EQ(after->layout, before->layout);
  EXPECT_EQ(script_->uploads, uploads);
  EXPECT_EQ(after->revision, 2U);
  EXPECT_GT(after->tile_version, before->tile_version);
  EXPECT_NEAR(meanIrradiance(*after) / meanIrradiance(*before), 2.0, 0.1);
  ASSERT_EQ(recorder_->patched().size(), 1U);
  EXPECT_EQ(recorder_->patched()[0].revision, 2U);
  EXPECT_EQ(recorder_->patched()[0].by, "ann");
}

TEST_F(Edits, AMovedReceiverIsChartedAndSolvedAnew) {
  solve(test_scenes::parallelPlates(1.0, 1.0, 1.0, 1.0, 0.3));
  const auto before = status();
  const auto layout = engine().lightmaps()->layout;
  const auto outcome = patch(R"([{"op":"replace","path":"/nodes/1/translation","value":[0,2,0]}])");
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->affected_surfaces, 2U);
  EXPECT_EQ(outcome->affected_shots, before.shots);
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  EXPECT_GT(engine().lightmaps()->layout, layout);
  EXPECT_NEAR(status().energy.emitted, before.energy.emitted, 1e-5 * before.energy.emitted);
  // form factors 0.1998 and 0.0686 (opposite unit squares at distance 1 and 2)
  EXPECT_NEAR(status().energy.absorbed / before.energy.absorbed, 0.0686 / 0.1998, 0.05);
}

TEST_F(Edits, ANewNameRaisesTheRevisionAndLeavesTheSolveAlone) {
  solve(lumpedCube(0.5));
  const auto before = status();
  std::uint64_t revision = before.revision;
  for (const char* path : {"/materials/0/name", "/nodes/0/name", "/meshes/0/name"}) {
    const auto outcome = patch(R"([{"op":"add","path":")" + std::string(path) + R"(","value":"plaster"}])");
    ASSERT_TRUE(outcome) << outcome.error().text();
    EXPECT_EQ(outcome->revision, ++revision);
    EXPECT_EQ(outcome->affected_surfaces, 0U) << path;
    EXPECT_EQ(status().revision, revision);
    EXPECT_EQ(status().state, SolveState::kConverged);
    EXPECT_EQ(status().shots, before.shots);
  }
}

TEST_F(Edits, AnEditOfAPausedSolveLeavesItPausedAndShowsTheNewLayout) {
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kNever; }));
  ASSERT_TRUE(load(test_scenes::parallelPlates(1.0, 1.0, 1.0, 1.0, 0.3)));
  ASSERT_EQ(pause().value(), SolveState::kPaused);
  const auto layout = engine().lightmaps()->layout;
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/nodes/1/translation","value":[0,2,0]}])"));
  EXPECT_EQ(status().state, SolveState::kPaused);
  EXPECT_EQ(status().shots, 0U);
  EXPECT_GT(engine().lightmaps()->layout, layout);
  EXPECT_EQ(engine().lightmaps()->revision, 2U);
}

TEST_F(Edits, OfLightInAPausedSolveAreSeenAtOnce) {
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kNever; }));
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(eventually([&] { return status().energy.absorbed > 0.0; }));
  ASSERT_EQ(pause().value(), SolveState::kPaused);
  const auto shots = status().shots;
  ASSERT_TRUE(patch(emissionPatch(1, 2.0 / kPi)));  // all there is, twice
  const auto once = status();
  ASSERT_TRUE(patch(emissionPatch(1, 4.0 / kPi)));
  EXPECT_EQ(status().state, SolveState::kPaused);
  EXPECT_EQ(status().shots, shots);
  EXPECT_NEAR(status().energy.absorbed / once.energy.absorbed, 2.0, 1e-4);
}

TEST_F(Edits, WarningsSpeakOfThePresentMaterialsOnly) {
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kNever; }));
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(pause());
  const auto paint = [&](int material, const char* color) {
    const auto outcome = patch(R"([{"op":"replace","path":"/materials/)" + std::to_string(material) +
                               R"(/pbrMetallicRoughness/baseColorFactor","value":)" + color + "}]");
    EXPECT_TRUE(outcome) << outcome.error().text();
    return clampWarnings();
  };
  EXPECT_EQ(clampWarnings(), 0U);
  EXPECT_EQ(paint(1, "[1,1,1,1]"), 1U);
  for (const char* color : {"[1,1,0.5,1]", "[1,0.5,1,1]", "[0.5,1,1,1]"}) EXPECT_EQ(paint(0, color), 2U) << color;
  EXPECT_EQ(paint(0, "[0.5,0.5,0.5,1]"), 1U);
}

}  // namespace
}  // namespace radiosity::test
