// An engine that ends, and another that begins where it was.
#include <gmock/gmock.h>

#include <filesystem>

#include "common/archive.h"
#include "server/engine/persist/checkpoint_head.h"
#include "server/state/checkpoint.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"
#include "tests/unit/client/temporary_folder.h"
#include "tests/unit/engine/block_room.h"
#include "tests/unit/engine/engine_driver.h"
#include "tests/unit/state/file_limit.h"

namespace radiosity::test {
namespace {

using test_scenes::lumpedCube;
using namespace std::chrono_literals;

constexpr auto kPatienceForCheckpoint = 20s;

std::string translationPatch(double x) {
  return R"([{"op":"replace","path":"/nodes/0/translation","value":[)" + std::to_string(x) + ",0,0]}]";
}

class Kept : public EngineTest {
 protected:
  void SetUp() override { start(); }

  void start() {
    auto options = rayOptions(script_);
    options.settings.target_error = target_;
    options.named_settings = named_;
    if (recovers_late_) options.recovery_wait = std::chrono::hours(1);
    ASSERT_NO_FATAL_FAILURE(startOn(folder_.file("state"), std::move(options)));
    engine_->addListener(recorder_);
    watching_ = engine_->watch(engine::Quantity::kIrradiance);
  }
  void restart() {
    watching_.reset();
    engine_.reset();
    start();
  }
  [[nodiscard]] double counter(const std::string& name) { return status().counters[name]; }

  TemporaryFolder folder_;
  double target_ = kEasy;
  bool recovers_late_ = false;
  std::set<std::string> named_ = {"targetError"};
};

TEST_F(Kept, TheSceneIsBackAtItsLastRevisionWithItsPast) {
  solve(lumpedCube(0.5));
  ASSERT_TRUE(patch({.patch = emissionPatch(0, 2.0), .by = "ann", .receipt = {"id-1", 77}}));
  ASSERT_TRUE(patch(translationPatch(0.25)));
  ASSERT_TRUE(undo());
  const auto text = sceneText();
  const auto before = history();
  restart();
  EXPECT_EQ(status().revision, 4U);
  EXPECT_EQ(sceneText(), text);
  const auto after = history();
  EXPECT_EQ(after.undoable, 1U);
  EXPECT_EQ(after.redoable, 1U);
  ASSERT_EQ(after.revisions.size(), 4U);
  for (std::size_t i = 0; i < 4; ++i) {
    EXPECT_EQ(after.revisions[i].summary, before.revisions[i].summary);
    EXPECT_EQ(after.revisions[i].by, before.revisions[i].by);
    EXPECT_EQ(after.revisions[i].time_s, before.revisions[i].time_s);
    EXPECT_EQ(after.revisions[i].undone, before.revisions[i].undone);
  }
  const auto& past = engine().past();
  EXPECT_EQ(past.patches_from, 1U);
  ASSERT_EQ(past.patches.size(), 3U);
  EXPECT_EQ(past.patches[0].by, "ann");
  ASSERT_EQ(past.answers.size(), 1U);
  EXPECT_EQ(past.answers[0].receipt.fingerprint, 77U);
  EXPECT_EQ(past.answers[0].outcome.revision, 2U);
  EXPECT_EQ(redo()->stepped, 3U);
  EXPECT_EQ(undo()->revision, 6U);
  EXPECT_EQ(undo()->stepped, 2U);
}

// How many shots an edit of geometry touches is known only after it was kept.
TEST_F(Kept, AnEditIsAnsweredAfterTheRestartAsItWasBefore) {
  solve(blockRoom());
  const auto moved = patch({.patch = R"([{"op":"replace","path":"/nodes/2/translation","value":[0.7,0,0.6]}])",
                            .by = "test",
                            .receipt = {"move", 7}});
  ASSERT_TRUE(moved) << moved.error().text();
  restart();
  const auto& answers = engine().past().answers;
  ASSERT_EQ(answers.size(), 1U);
  EXPECT_EQ(answers[0].outcome.affected_shots, moved->affected_shots);
  EXPECT_EQ(answers[0].outcome.affected_surfaces, moved->affected_surfaces);
}

TEST_F(Kept, ManyRestartsAndManyEditsLoseNothing) {
  ASSERT_TRUE(load(lumpedCube(0.5)));
  std::uint64_t revision = 1;
  for (int run = 0; run < 5; ++run) {
    for (int i = 0; i < 70; ++i) {
      const auto done = i % 10 == 9 ? undo() : patch(emissionPatch(0, 1.0 + run + 0.01 * i));
      ASSERT_TRUE(done) << done.error().text();
      EXPECT_EQ(done->revision, ++revision);
    }
    const auto text = sceneText();
    const auto past = history();
    restart();
    EXPECT_EQ(status().revision, revision);
    EXPECT_EQ(sceneText(), text);
    EXPECT_EQ(history().undoable, past.undoable);
    EXPECT_EQ(history().revisions.size(), past.revisions.size());
  }
}

TEST_F(Kept, ADoneSolveIsDoneAtOnceAfterTheRestartWithTheSameLight) {
  solve(lumpedCube(0.5));
  const auto before = light();
  const auto shots = status().shots;
  const auto version = status().tile_version;
  engine().keepSolve(kPatienceForCheckpoint);
  restart();
  ASSERT_TRUE(reaches(State::kConverged));
  EXPECT_EQ(status().shots, shots);
  EXPECT_EQ(counter("state.resumedShots"), static_cast<double>(shots));
  EXPECT_TRUE(light() == before);
  EXPECT_GT(status().tile_version, version);
  EXPECT_GT(engine().past().first_tile_version, version);
}

TEST_F(Kept, AnInterruptedSolveEndsWithTheSameLightAsOneThatWasNot) {
  target_ = 0.005;
  restart();
  solve(lumpedCube(0.7));
  const auto before = light();
  const auto samples = counter("links.samples");
  ASSERT_TRUE(load(lumpedCube(0.7)));  // once more, from nothing
  int interrupted = 0;
  for (int i = 0; i < 50 && status().state == State::kSolving; ++i) {
    std::this_thread::sleep_for(2ms);
    const bool solving = status().state == State::kSolving;
    engine().keepSolve(kPatienceForCheckpoint);
    restart();
    if (solving && counter("state.resumedShots") > 0) ++interrupted;
  }
  ASSERT_TRUE(reaches(State::kConverged));
  EXPECT_GT(interrupted, 0);
  EXPECT_EQ(counter("links.samples"), samples);
  EXPECT_TRUE(light() == before);
}

TEST_F(Kept, ACheckpointFromBeforeAnEditOfLightServesAfterIt) {
  solve(lumpedCube(0.5));
  engine().keepSolve(kPatienceForCheckpoint);
  const auto saved = folder_.read("state/checkpoint");
  ASSERT_TRUE(patch(emissionPatch(0, 5.0)));
  ASSERT_TRUE(reaches(State::kPaused));  // by keepSolve()
  watching_.reset();
  engine_.reset();
  folder_.write("state/checkpoint", saved);
  start();
  EXPECT_GT(counter("state.resumedShots"), 0.0);
  ASSERT_TRUE(reaches(State::kConverged));
  EXPECT_EQ(status().revision, 2U);
}

TEST_F(Kept, ACheckpointOfAnotherGeometryOrOtherSettingsIsOfNoUse) {
  solve(lumpedCube(0.5));
  engine().keepSolve(kPatienceForCheckpoint);
  const auto saved = folder_.read("state/checkpoint");
  const auto restartWith = [&](const std::string& checkpoint) {
    watching_.reset();
    engine_.reset();
    folder_.write("state/checkpoint", checkpoint);
    start();
    return counter("state.resumedShots");
  };
  ASSERT_GT(restartWith(saved), 0.0);
  ASSERT_TRUE(configure([](auto& settings) { settings.seed = 9; }));
  EXPECT_EQ(restartWith(saved), 0.0);
  ASSERT_TRUE(configure([](auto& settings) { settings.seed = 1; }));
  ASSERT_GT(restartWith(saved), 0.0);
  EXPECT_EQ(restartWith(saved.substr(0, saved.size() / 2)), 0.0);
  ASSERT_TRUE(reaches(State::kConverged));  // anew
  ASSERT_TRUE(patch(translationPatch(0.5)));
  EXPECT_EQ(restartWith(saved), 0.0);
}

TEST_F(Kept, SettingsComeBackUnlessTheCommandLineNamesThem) {
  ASSERT_TRUE(configure([](auto& settings) {
    settings.target_error = 0.125;
    settings.texels = 123;
    settings.seed = 7;
    settings.time_limit_s = 3.5;
    settings.sky = engine::SkySetting{{1.1F, 2.0F, 3.0F}, {0.1F, 0.0F, 0.0F}};
    settings.double_sided = true;
    settings.method = Method::kShooting;
  }));
  named_ = {};
  restart();
  const auto settings = status().settings;
  EXPECT_EQ(settings.target_error, 0.125);
  EXPECT_EQ(settings.texels, 123U);
  EXPECT_EQ(settings.seed, 7U);
  EXPECT_EQ(settings.time_limit_s, 3.5);
  EXPECT_EQ(settings.sky, (engine::SkySetting{{1.1F, 2.0F, 3.0F}, {0.1F, 0.0F, 0.0F}}));
  EXPECT_TRUE(settings.double_sided);
  EXPECT_EQ(settings.method, Method::kShooting);
  named_ = {"targetError", "seed", "doubleSided", "method"};
  restart();
  EXPECT_EQ(status().settings.target_error, kEasy);
  EXPECT_EQ(status().settings.seed, 1U);
  EXPECT_EQ(status().settings.texels, 123U);
  EXPECT_FALSE(status().settings.double_sided);
  EXPECT_EQ(status().settings.method, Method::kGather);
}

TEST_F(Kept, SettingsThatCannotBeLitAreNotKept) {
  solve(lumpedCube(0.5));
  const auto texels = status().settings.texels;
  const auto refused = configure([](auto& settings) { settings.texels = std::uint64_t{1} << 32U; });
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kTooLarge);
  EXPECT_EQ(status().settings.texels, texels);
  script_->uploads_to_fail = 1;
  EXPECT_FALSE(configure([](auto& settings) { settings.texels = 600; }));
  EXPECT_EQ(status().settings.texels, texels);
  restart();
  EXPECT_EQ(status().settings.texels, texels);
  EXPECT_TRUE(reaches(State::kConverged));
}

// As after a move to a machine with less memory.
TEST_F(Kept, TexelsThatThereIsNoMemoryForAnyMoreGiveWayToThoseOfTheCommandLine) {
  solve(lumpedCube(0.5));
  const auto patches = status().patches;
  watching_.reset();
  engine_.reset();
  {
    auto store = state::Store::open(folder_.file("state"));
    ASSERT_TRUE(store);
    auto settings = (*store)->takeKept().settings;
    settings["texels"] = "4294967296";
    ASSERT_TRUE((*store)->setSettings(settings));
  }
  start();
  EXPECT_EQ(status().settings.texels, 150U);
  ASSERT_TRUE(reaches(State::kConverged));
  EXPECT_EQ(status().patches, patches);
}

TEST_F(Kept, TheSceneItWasStartedWithGoesOnWithItsEdits) {
  const auto file = folder_.write("room.glb", "");
  const auto write = [&](double reflectance) {
    const auto bytes = test_scenes::encodeGlb(lumpedCube(reflectance));
    folder_.write("room.glb", std::string(bytes.begin(), bytes.end()));
  };
  const auto open = [&](bool anew = false) {
    const auto opened = call<engine::LoadOutcome>([&](auto done) { engine_->openFile(file, anew, std::move(done)); });
    return opened.value().revision;
  };
  write(0.5);
  EXPECT_EQ(open(), 1U);
  restart();
  EXPECT_EQ(load(lumpedCube(0.5))->revision, 1U);  // the very scene, as it was loaded
  ASSERT_TRUE(patch(emissionPatch(0, 2.0)));
  restart();
  EXPECT_EQ(open(), 2U);
  EXPECT_EQ(load(lumpedCube(0.5))->revision, 3U);  // a client asks for the scene without the edit
  restart();
  write(0.25);
  EXPECT_EQ(open(), 3U);  // what was acknowledged is not thrown away for a file that has changed,
  ASSERT_TRUE(patch(emissionPatch(0, 2.0)));
  restart();
  EXPECT_EQ(open(), 4U);  // nor what was edited,
  EXPECT_EQ(history().undoable, 1U);
  EXPECT_EQ(open(true), 5U);  // but where that is asked for
  EXPECT_EQ(load(lumpedCube(0.75))->revision, 6U);
  restart();
  EXPECT_EQ(open(), 6U);  // nor what a client loaded in its place
}

TEST_F(Kept, WhatCannotBeKeptIsRefusedAndAllStaysAsItWas) {
  solve(lumpedCube(0.5));
  const auto before = light();
  const auto text = sceneText();
  recorder_->forget();
  {
    const FileLimit full(std::filesystem::file_size(folder_.file("state/state.sqlite-wal")));
    for (const auto& edit : {emissionPatch(0, 3.0), translationPatch(0.5)}) {
      const auto refused = patch(edit);
      ASSERT_FALSE(refused);
      EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
      EXPECT_NE(refused.error().message.find(folder_.file("state/state.sqlite")), std::string::npos);
    }
    EXPECT_FALSE(load(lumpedCube(0.25)));
    EXPECT_FALSE(configure([](auto& settings) { settings.seed = 5; }));
  }
  EXPECT_EQ(status().revision, 1U);
  EXPECT_EQ(status().state, State::kConverged);
  EXPECT_EQ(status().settings.seed, 1U);
  EXPECT_EQ(sceneText(), text);
  EXPECT_TRUE(light() == before);
  EXPECT_TRUE(recorder_->patched().empty());
  EXPECT_TRUE(recorder_->loaded().empty());
  EXPECT_EQ(history().undoable, 0U);
  EXPECT_EQ(patch(emissionPatch(0, 3.0))->revision, 2U);  // there is room again
  EXPECT_EQ(patch(translationPatch(0.5))->revision, 3U);
  ASSERT_TRUE(reaches(State::kConverged));
  restart();
  EXPECT_EQ(status().revision, 3U);
}

// Its charts lie where the edit found them; a scene that is built anew from the same document has others.
// As on a full disk: nothing is made that the next start would not find.
TEST_F(Kept, WithoutItsFolderNothingIsMadeUntilThatIsBack) {
  solve(lumpedCube(0.5));
  std::filesystem::rename(folder_.file("state"), folder_.file("away"));
  const auto edited = patch(emissionPatch(0, 2.0));
  ASSERT_FALSE(edited);
  EXPECT_EQ(edited.error().code, ErrorCode::kUnavailable);
  EXPECT_THAT(edited.error().message, testing::HasSubstr(folder_.file("state/lock") + ": was removed or moved away"));
  EXPECT_FALSE(configure([](auto& settings) { settings.seed = 5; }));
  EXPECT_FALSE(load(lumpedCube(0.25)));
  EXPECT_TRUE(eventually([&] { return status().state_trouble.find("state/lock") != std::string::npos; }));
  EXPECT_EQ(status().revision, 1U);
  std::filesystem::rename(folder_.file("away"), folder_.file("state"));
  EXPECT_TRUE(eventually([&] { return status().state_trouble.empty(); }));
  const auto again = patch(emissionPatch(0, 2.0));
  ASSERT_TRUE(again) << again.error().text();
  restart();
  EXPECT_EQ(status().revision, 2U);
}

TEST_F(Kept, ASolveOfEditedGeometryBeginsAnewAfterARestart) {
  solve(lumpedCube(0.5));
  engine().keepSolve(kPatienceForCheckpoint);
  restart();  // it had paused
  const auto loaded = folder_.read("state/checkpoint");
  ASSERT_TRUE(patch(translationPatch(0.5)));
  ASSERT_TRUE(reaches(State::kConverged));
  engine().keepSolve(kPatienceForCheckpoint);
  EXPECT_TRUE(folder_.read("state/checkpoint") == loaded) << "one was taken of it";
  restart();
  EXPECT_EQ(status().revision, 2U);
  EXPECT_EQ(counter("state.resumedShots"), 0.0);
  EXPECT_TRUE(reaches(State::kConverged));
}

/// A double-sided room, a lamp at its ceiling and a light in the block on its floor, whose inside has texels for that.
test_scenes::TestScene lightInTheBlock() {
  auto scene = blockRoom();
  for (auto& material : scene.materials) material.double_sided = material.emission_nits == glm::dvec3(0.0);
  scene.lights.push_back({.position = {0.6, 0.4, 0.6}, .intensity = glm::dvec3(5.0)});
  return scene;
}
constexpr const char* kLightOut = R"([{"op":"replace","path":"/nodes/3/translation","value":[1.6,1.0,1.6]}])";

// Laid out anew, by the lamps that it has now, the scene would have no texels there.
TEST_F(Kept, ALightThatMovesAmongDoubleSidedSurfacesLeavesTheLayoutAndItsCheckpoint) {
  auto scene = lightInTheBlock();
  solve(scene);
  const auto nodes = status().nodes;
  const auto moved = patch(kLightOut);
  ASSERT_TRUE(moved) << moved.error().text();
  ASSERT_EQ(moved->affected_shots, 0U) << "it is no edit of geometry";
  ASSERT_TRUE(reaches(State::kConverged));
  const auto before = light();
  const auto shots = status().shots;
  engine().keepSolve(kPatienceForCheckpoint);
  restart();
  ASSERT_TRUE(reaches(State::kConverged));
  EXPECT_EQ(counter("state.resumedShots"), static_cast<double>(shots));
  EXPECT_EQ(status().nodes, nodes);
  EXPECT_TRUE(light() == before);
  scene.lights[0].position = {1.6, 1.0, 1.6};
  solve(scene);
  EXPECT_NE(status().nodes, nodes);
}

TEST_F(Kept, AFurnishedDoubleSidedRoomGoesOnWithTheSameBitsAfterALightMoved) {
  auto scene = test_scenes::doubleSidedTwin(test_scenes::smallRoom());
  const auto node = std::to_string(scene.objects.size());
  scene.lights.push_back({.position = {0.3, 0.3, 0.2}, .intensity = glm::dvec3(5.0)});
  ASSERT_TRUE(configure([](auto& settings) { settings.texels = 2000; }));
  solve(scene);
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/nodes/)" + node + R"(/translation","value":[0.1,1.9,0.4]}])"));
  ASSERT_TRUE(reaches(State::kConverged));
  const auto before = light();
  const auto shots = status().shots;
  engine().keepSolve(kPatienceForCheckpoint);
  restart();
  ASSERT_TRUE(reaches(State::kConverged));
  EXPECT_EQ(counter("state.resumedShots"), static_cast<double>(shots));
  EXPECT_TRUE(light() == before);
}

TEST_F(Kept, ACheckpointWhoseSidesNoSurfaceCanHaveIsOfNoUse) {
  solve(lightInTheBlock());
  ASSERT_TRUE(patch(kLightOut));
  ASSERT_TRUE(reaches(State::kConverged));
  engine().keepSolve(kPatienceForCheckpoint);
  watching_.reset();
  engine_.reset();
  const auto file = std::filesystem::path(folder_.file("state/checkpoint"));
  const auto body = state::readCheckpoint(file).value().value();
  ArchiveReader from(body);
  engine::CheckpointHead head;
  engine::CheckpointHead::visit(from, head);
  const auto bytesOf = [](const engine::CheckpointHead& of) {
    ArchiveWriter to(std::size_t{1} << 30);
    engine::CheckpointHead::visit(to, of);
    return to.take();
  };
  const auto head_bytes = static_cast<std::ptrdiff_t>(bytesOf(head).size());
  for (const unsigned bits : {scene::kLeftCoarse << 1U, scene::kBackLit}) {
    auto damaged = head;
    damaged.sides[0] = static_cast<std::uint8_t>(bits);
    auto bytes = bytesOf(damaged);
    bytes.insert(bytes.end(), body.begin() + head_bytes, body.end());
    ASSERT_TRUE(state::writeCheckpoint(file, bytes));
    start();
    EXPECT_EQ(counter("state.resumedShots"), 0.0) << bits;
    EXPECT_TRUE(reaches(State::kConverged)) << bits;
    watching_.reset();
    engine_.reset();
  }
  start();
}

// What was measured of the wave that failed would count twice.
TEST_F(Kept, ASolveWithoutARendererLeavesTheCheckpointBeforeIt) {
  recovers_late_ = true;
  restart();
  solve(lumpedCube(0.5));
  const auto undisturbed = light();
  for (const int run : {1, 2, 3, 4}) {
    script_->runs_until_failure = run;
    ASSERT_TRUE(test::EngineTest::restart());
    ASSERT_TRUE(eventually([&] { return status().renderer_lost; })) << run;
    engine().keepSolve(kPatienceForCheckpoint);
    restart();
    ASSERT_TRUE(reaches(State::kConverged));
    EXPECT_TRUE(light() == undisturbed) << run;
  }
}

TEST_F(Kept, ASolveTooLargeForACheckpointGoesOnWithout) {
  watching_.reset();
  engine_.reset();
  auto options = rayOptions(script_);
  options.checkpoint_bytes = 1000;
  ASSERT_NO_FATAL_FAILURE(startOn(folder_.file("state"), std::move(options)));
  solve(lumpedCube(0.5));
  engine().keepSolve(kPatienceForCheckpoint);
  EXPECT_FALSE(std::filesystem::exists(folder_.file("state/checkpoint")));
}

}  // namespace
}  // namespace radiosity::test
