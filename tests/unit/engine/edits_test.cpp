// Edits are whole or not at all, and only what they touch is solved again.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/block_room.h"
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
  const auto late = patch({.patch = emissionPatch(1, 5.0), .base_revision = 1, .by = "late"});
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, ErrorCode::kStaleRevision);
  EXPECT_EQ(sceneText(), text);
}

TEST_F(Edits, AnEditOfASceneThatWasReplacedDoesNotLandInTheOther) {
  solve(lumpedCube(0.5));
  ASSERT_TRUE(patch(emissionPatch(1, 1.0)));
  // Others' edits do not matter.
  ASSERT_TRUE(patch({.patch = emissionPatch(1, 2.0), .same_scene_as = 1, .by = "ben"}));
  ASSERT_TRUE(load(lumpedCube(0.4)));
  const auto text = sceneText();
  const auto late = patch({.patch = emissionPatch(1, 5.0), .same_scene_as = 3, .by = "ben"});
  ASSERT_FALSE(late);
  EXPECT_EQ(late.error().code, ErrorCode::kStaleRevision);
  EXPECT_EQ(sceneText(), text);
  EXPECT_EQ(status().revision, 4U);
  EXPECT_TRUE(patch({.patch = emissionPatch(1, 5.0), .same_scene_as = 4, .by = "ben"}));
}

TEST_F(Edits, OfTwoWritersOnOneRevisionExactlyOneWins) {
  solve(lumpedCube(0.5));
  std::promise<Result<engine::PatchOutcome>> first, second;
  engine().patch({.patch = emissionPatch(1, 2.0), .base_revision = 1, .by = "a"},
                 [&](auto outcome) { first.set_value(std::move(outcome)); });
  engine().patch({.patch = emissionPatch(1, 3.0), .base_revision = 1, .by = "b"},
                 [&](auto outcome) { second.set_value(std::move(outcome)); });
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
  const auto outcome = patch({.patch = emissionPatch(1, 9.0), .base_revision = 1, .dry_run = true, .by = "dry"});
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->revision, 1U);
  EXPECT_EQ(sceneText(), text);
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_TRUE(recorder_->patched().empty());
  EXPECT_EQ(patch({.patch = R"([{"op":"replace","path":"/nodes/0/mesh","value":99}])", .dry_run = true, .by = "dry"})
                .error()
                .code,
            ErrorCode::kInvalidScene);
}

TEST_F(Edits, ABrighterLampKeepsTheLayoutAndScalesTheLight) {
  solve(lumpedCube(0.5));
  const auto before = engine().lightmaps();
  const auto uploads = script_->uploads.load();
  const auto outcome = patch({.patch = emissionPatch(1, 2.0 / kPi), .base_revision = 1, .by = "ann"});
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
  // So far off that the scene's unit box is another: nothing stays.
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
  // Reflected light, too: before any ray is traced the light of lamps alone is half of it.
  ASSERT_TRUE(eventually([&] { return status().energy.absorbed > 0.9 * status().energy.emitted; }));
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

// The order of nodes is that in which surfaces are numbered.
TEST_F(Edits, OtherOrderOfTheSameNodesKeepsTheLight) {
  solve(blockRoom());
  const auto before = meanIrradiance(*engine().lightmaps());
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/scenes/0/nodes","value":[2,1,0]}])"));
  ASSERT_TRUE(reaches(State::kConverged));
  EXPECT_NEAR(meanIrradiance(*engine().lightmaps()), before, 1e-3 * before);
  ASSERT_TRUE(patch(emissionPatch(1, 20.0)));
  ASSERT_TRUE(reaches(State::kConverged));
  EXPECT_NEAR(meanIrradiance(*engine().lightmaps()), 2.0 * before, 2e-3 * before);
}

TEST_F(Edits, AMaterialThatNoLitSurfaceHasLeavesTheErrorKnown) {
  auto scene = blockRoom();
  const auto unseen = scene.add({"unseen", glm::dvec3(0.5), glm::dvec3(0.0)});
  test_scenes::Object point{"point", {}, {}};
  appendBox(point, {1.5, 0.5, 1.5}, {1.7, 0.7, 1.7}, test_scenes::allFaces(unseen));
  scene.objects.push_back(point);
  solve(scene);
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/nodes/3/scale","value":[0,0,0]}])"));
  ASSERT_TRUE(reaches(State::kConverged));
  const auto error = status().error.texels;
  const auto outcome =
      patch(R"([{"op":"replace","path":"/materials/3/pbrMetallicRoughness/baseColorFactor","value":[0.2,0.3,0.4,1]}])");
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->affected_surfaces, 0U);
  EXPECT_EQ(status().state, State::kConverged);
  EXPECT_EQ(status().error.texels, error);
}

TEST_F(Edits, AppendingWhatNobodyPlacesYetCostsNothing) {
  solve(lumpedCube(0.5));
  const auto before = status();
  const auto outcome = patch(R"([{"op":"add","path":"/materials/-","value":{"name":"new"}},
                                 {"op":"add","path":"/nodes/-","value":{"name":"spare","mesh":0}}])");
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->affected_surfaces, 0U);
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_EQ(status().shots, before.shots);
}

TEST_F(Edits, ADryRunTellsWhatItWouldTouch) {
  solve(lumpedCube(0.5));
  const auto bright = patch({.patch = emissionPatch(1, 9.0), .base_revision = 1, .dry_run = true, .by = "dry"});
  ASSERT_TRUE(bright);
  EXPECT_EQ(bright->affected_surfaces, 1U);
  EXPECT_EQ(bright->affected_shots, 0U);
  const auto moved = patch(
      {.patch = R"([{"op":"replace","path":"/nodes/0/translation","value":[0,2,0]}])", .dry_run = true, .by = "dry"});
  ASSERT_TRUE(moved);
  EXPECT_EQ(moved->affected_surfaces, status().surfaces);
  EXPECT_EQ(moved->affected_shots, status().shots);
}

// ---- undo and redo ----

TEST_F(Edits, UndoOfAColourNeedsNoGeometryAndNoShot) {
  solve(lumpedCube(0.5));
  const auto scene = nlohmann::json::parse(sceneText());
  const auto before = light();
  ASSERT_TRUE(patch(emissionPatch(1, 2.0)));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  const auto uploads = script_->uploads.load();
  const auto shots = status().shots;
  recorder_->forget();
  const auto back = undo();
  ASSERT_TRUE(back) << back.error().text();
  EXPECT_EQ(back->revision, 3U);
  EXPECT_EQ(back->stepped, 2U);
  EXPECT_EQ(back->affected_surfaces, 1U);
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_EQ(nlohmann::json::parse(sceneText()), scene);
  EXPECT_EQ(script_->uploads, uploads);
  EXPECT_EQ(status().shots, shots);
  EXPECT_TRUE(light() == before) << "the same bits";
  ASSERT_EQ(recorder_->patched().size(), 1U);
  EXPECT_EQ(recorder_->patched()[0].by, "undoer");
  const auto forth = redo();
  ASSERT_TRUE(forth) << forth.error().text();
  EXPECT_EQ(forth->revision, 4U);
  EXPECT_NE(nlohmann::json::parse(sceneText()), scene);
  EXPECT_EQ(redo().error().code, ErrorCode::kNotFound);
}

constexpr const char* kMove = R"([{"op":"add","path":"/nodes/0/translation","value":[0.1,0.2,0]}])";

TEST_F(Edits, UndoAndRedoOfAMoveShowTheSolvesThatWereThere) {
  solve(lumpedCube(0.5));
  const auto scene = sceneText();
  const auto before = light();
  ASSERT_TRUE(patch(kMove));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  ASSERT_TRUE(eventually([&] { return status().counters["edits.samplesWaiting"] == 0.0; }));
  const auto moved_scene = sceneText();
  const auto moved = light();
  EXPECT_FALSE(moved == before);
  script_->run_fails = true;  // nothing is measured
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(configure([](auto&) {}));  // who asks what settings are leaves the way back
    const auto back = undo();
    ASSERT_TRUE(back) << back.error().text();
    EXPECT_GT(back->affected_surfaces, 0U);
    EXPECT_EQ(back->affected_shots, 0U);
    ASSERT_TRUE(reaches(SolveState::kConverged));
    EXPECT_EQ(sceneText(), scene);
    EXPECT_TRUE(light() == before) << "the same bits";
    ASSERT_TRUE(redo());
    ASSERT_TRUE(reaches(SolveState::kConverged));
    EXPECT_EQ(sceneText(), moved_scene);
    EXPECT_TRUE(light() == moved) << "the same bits";
  }
}

TEST_F(Edits, BackToAPlaceInAnotherLightIsSolvedOverTheLinksThatWereThere) {
  solve(lumpedCube(0.5));
  ASSERT_TRUE(patch(emissionPatch(1, 1.0)));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  const auto before = light();
  ASSERT_TRUE(patch(kMove));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  ASSERT_TRUE(patch(emissionPatch(1, 2.0)));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  script_->run_fails = true;  // nothing is measured
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/nodes/0/translation","value":[0,0,0]}])"));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_FALSE(light() == before) << "the lamp is another";
  ASSERT_TRUE(patch(emissionPatch(1, 1.0)));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_TRUE(light() == before) << "the same bits";
}

/// What is kept of the scene before an edit never makes links and rays take more than they may.
TEST_F(Edits, ASceneWhoseLinksFillTheirMemoryIsSolvedAgainOnItsWayBack) {
  auto scene = lumpedCube(0.5);
  for (int i = 0; i < 400; ++i)  // each has links to all texels
    scene.lights.push_back({.position = {0.1 + 0.002 * i, 0.5, 0.5}, .intensity = glm::dvec3(1e-3)});
  solve(scene);
  constexpr std::uint64_t kTight = 800'000;  // of which lamps take a third, and rays as much as there is
  for (const bool fits : {false, true}) {
    ASSERT_TRUE(configure([&](auto& settings) {
      settings.link_memory_bytes = fits ? 8 * kTight : kTight;
      settings.target_error = fits ? kEasy : kNever;
    }));
    ASSERT_TRUE(reaches(fits ? SolveState::kConverged : SolveState::kLimited));
    ASSERT_GT(status().counters["rays"], 0.0);
    ASSERT_EQ(2 * static_cast<std::uint64_t>(status().counters["links.bytes"]) <= status().settings.link_memory_bytes,
              fits)
        << status().counters["links.bytes"];
    const auto returned = status().counters["skip.solvesReturned"];
    ASSERT_TRUE(patch(kMove));
    ASSERT_TRUE(reaches(SolveState::kConverged) || reaches(SolveState::kLimited));
    ASSERT_TRUE(undo());
    (void)sceneText();
    EXPECT_EQ(status().counters["skip.solvesReturned"] > returned, fits);
  }
}

TEST_F(Edits, ASceneThatIsShotForWantOfMemoryRemembersNothingButItsLight) {
  solve(lumpedCube(0.5));
  constexpr std::uint64_t kTight = 244'000;  // too little for rays
  for (const bool fits : {false, true}) {
    ASSERT_TRUE(configure([&](auto& settings) { settings.link_memory_bytes = fits ? 8 * kTight : kTight; }));
    ASSERT_TRUE(reaches(SolveState::kConverged));
    ASSERT_EQ(status().counters["rays"] > 0.0, fits);
    ASSERT_EQ(status().counters["links.bytes"] > 0.0, fits);
    ASSERT_LE(2 * static_cast<std::uint64_t>(status().counters["links.bytes"]), status().settings.link_memory_bytes);
    const auto returned = status().counters["skip.solvesReturned"];
    ASSERT_TRUE(patch(kMove));
    ASSERT_TRUE(reaches(SolveState::kConverged) || reaches(SolveState::kLimited));
    ASSERT_TRUE(undo());
    (void)sceneText();
    EXPECT_GT(status().counters["skip.solvesReturned"], returned);
  }
}

TEST_F(Edits, UndoAndItsPatchLeadBackThroughEveryKindOfEdit) {
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kNever; }));
  ASSERT_TRUE(load(test_scenes::parallelPlates(1.0, 1.0, 1.0, 1.0, 0.3)));
  ASSERT_TRUE(pause());
  std::vector<nlohmann::json> seen{nlohmann::json::parse(sceneText())};
  for (const char* edit :
       {R"([{"op":"replace","path":"/nodes/1/translation","value":[0,2,0]}])",
        R"([{"op":"add","path":"/nodes/-","value":{"name":"copy","mesh":0,"translation":[3,0,0]}},
            {"op":"add","path":"/scenes/0/nodes/-","value":3}])",
        R"([{"op":"replace","path":"/nodes/3/extensions/KHR_node_visibility/visible","value":false}])",
        R"([{"op":"replace","path":"/scenes/0/nodes","value":[0,1]}])",
        R"([{"op":"replace","path":"/materials/0/doubleSided","value":true},
            {"op":"add","path":"/nodes/0/extras","value":{"radiosityTexelScale":2}}])"}) {
    ASSERT_TRUE(patch(edit)) << edit;
    seen.push_back(nlohmann::json::parse(sceneText()));
  }
  recorder_->forget();
  for (std::size_t i = seen.size() - 1; i > 0; --i) {
    ASSERT_TRUE(undo());
    EXPECT_EQ(nlohmann::json::parse(sceneText()), seen[i - 1]);
    // The patch that everyone is told does the same on a copy, with any library.
    EXPECT_EQ(seen[i].patch(nlohmann::json::parse(recorder_->patched().back().patch)), seen[i - 1]);
  }
  EXPECT_FALSE(undo());
  EXPECT_EQ(history().undoable, 0U);
  EXPECT_EQ(history().redoable, 5U);
}

TEST_F(Edits, AStepOnAStaleRevisionIsRefused) {
  solve(lumpedCube(0.5));
  ASSERT_TRUE(patch(emissionPatch(1, 2.0)));
  const auto text = sceneText();
  EXPECT_EQ(step({false, 1, "late"}).error().code, ErrorCode::kStaleRevision);
  EXPECT_EQ(sceneText(), text);
  EXPECT_TRUE(step({false, 2, "in time"}));
}

}  // namespace
}  // namespace radiosity::test
