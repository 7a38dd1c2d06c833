// Targets, limits, pauses: when the solve stops and when it goes on.
#include <gtest/gtest.h>

#include <algorithm>
#include <future>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::SolveSettings;
using engine::SolveState;
using test_scenes::lumpedCube;

class Settings : public EngineTest {
 protected:
  /// Solves until the first slice is over: a limit that any clock passes.
  void runOutOfTime() {
    ASSERT_TRUE(configure([](SolveSettings& settings) {
      settings.time_limit_s = 0.0;
      settings.target_error = kNever;
    }));
    ASSERT_TRUE(load(lumpedCube(0.5)));
    ASSERT_TRUE(reaches(SolveState::kTimeLimit));
    (void)sceneText();
  }
};

TEST_F(Settings, GivenBeforeAnySceneTheyHoldForTheFirst) {
  const auto settings = configure([](SolveSettings& s) { s.texels = 600, s.seed = 7; });
  ASSERT_TRUE(settings);
  EXPECT_EQ(settings->texels, 600U);
  EXPECT_EQ(status().settings.seed, 7U);
  EXPECT_EQ(status().state, SolveState::kEmpty);
  solve(lumpedCube(0.5));
  EXPECT_EQ(status().settings.seed, 7U);
  EXPECT_GT(status().patches, 300U);  // the options of the fixture ask for 150
}

// An edit of light shows nothing before it is solved for. Paused before that, what there is counts as of its revision.
TEST_F(Settings, APauseRightAfterAnEditShowsWhatThereIs) {
  solve(lumpedCube(0.5));
  std::promise<void> busy, go;
  std::promise<Result<SolveState>> paused;
  const auto wait = [&busy, &go](SolveSettings settings) {
    busy.set_value();
    go.get_future().wait();
    return settings;
  };
  engine().configure(wait, [](const auto&) {});
  busy.get_future().wait();  // so that the next two come without a slice between
  engine().patch({.patch = emissionPatch(1, 2.0), .by = "test"}, [](const auto&) {});
  engine().pause([&](auto state) { paused.set_value(std::move(state)); });
  go.set_value();
  EXPECT_EQ(paused.get_future().get(), SolveState::kPaused);
  EXPECT_EQ(status().revision, 2U);
  EXPECT_EQ(engine().lightmaps()->revision, 2U);
  EXPECT_FALSE(engine().lightmaps()->final);
}

TEST_F(Settings, TheTimeLimitStopsTheSolveShortOfItsTarget) {
  runOutOfTime();
  EXPECT_GT(status().error.texels, kNever);
  EXPECT_GT(status().seconds, 0.0);
  ASSERT_TRUE(engine().lightmaps());
  EXPECT_FALSE(engine().lightmaps()->final);
}

TEST_F(Settings, TheTimeLimitEndsAlsoASolveOfWhichNoMeasurementComesToAnEnd) {
  script_->puts_off = true;
  script_->pause_ms = 50;
  runOutOfTime();
  EXPECT_GT(status().seconds, 0.0);
  EXPECT_TRUE(engine().lightmaps());
}

TEST_F(Settings, MemoryForLinksThatIsUsedUpEndsTheSolveAboveItsTargetAndAnEditGoesOn) {
  ASSERT_TRUE(configure([](SolveSettings& settings) {
    settings.link_memory_bytes = 400'000;
    settings.target_error = kNever;
  }));
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(reaches(SolveState::kLimited));
  const auto stopped = status();
  EXPECT_NE(stopped.failure.find("--link-memory"), std::string::npos) << stopped.failure;
  EXPECT_GT(stopped.error.texels, kNever);
  EXPECT_LE(stopped.counters.at("links.bytes"), 400'000.0);
  ASSERT_TRUE(engine().lightmaps());
  ASSERT_TRUE(configure([](SolveSettings& s) { s.target_error = kEasy; }));
  EXPECT_TRUE(reaches(SolveState::kConverged));
  EXPECT_TRUE(status().failure.empty());
  EXPECT_GE(status().shots, stopped.shots);  // it did not start over
}

TEST_F(Settings, ARaisedTimeLimitLetsAStoppedSolveGoOn) {
  runOutOfTime();
  const auto stopped = status();
  ASSERT_TRUE(configure([](SolveSettings& s) { s.time_limit_s = 3600.0; }));
  EXPECT_TRUE(eventually([&] { return status().shots > stopped.shots; }));
  EXPECT_GE(status().seconds, stopped.seconds);  // it did not start over
  EXPECT_EQ(status().state, SolveState::kSolving);
  ASSERT_TRUE(configure([](SolveSettings& s) { s.target_error = kEasy; }));
  EXPECT_TRUE(reaches(SolveState::kConverged));
}

TEST_F(Settings, ALiftedTimeLimitLetsAStoppedSolveGoOn) {
  runOutOfTime();
  ASSERT_TRUE(configure([](SolveSettings& s) { s.time_limit_s.reset(), s.target_error = kEasy; }));
  EXPECT_TRUE(reaches(SolveState::kConverged));
}

TEST_F(Settings, AnotherTargetWithinTheSameTimeLimitShootsNothingMore) {
  runOutOfTime();
  const auto stopped = status();
  ASSERT_TRUE(configure([](SolveSettings& s) { s.target_error = kNever / 2; }));
  (void)sceneText();
  EXPECT_EQ(status().state, SolveState::kTimeLimit);
  EXPECT_EQ(status().shots, stopped.shots);
}

TEST_F(Settings, ASmallerTargetGoesOnAndALargerOneIsReachedAtOnce) {
  solve(lumpedCube(0.5));
  const auto first = status();
  ASSERT_TRUE(configure([](SolveSettings& s) { s.target_error = kEasy / 4; }));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  const auto second = status();
  EXPECT_LE(second.error.texels, kEasy / 4);
  EXPECT_GT(second.shots, first.shots);
  ASSERT_TRUE(configure([](SolveSettings& s) { s.target_error = kNever, s.time_limit_s = 0.0; }));
  (void)sceneText();
  EXPECT_EQ(status().state, SolveState::kTimeLimit);  // more is wanted, but there is no time for it
  ASSERT_TRUE(configure([](SolveSettings& s) { s.target_error = kEasy; }));
  (void)sceneText();
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_EQ(status().shots, second.shots);
}

TEST_F(Settings, TheClockStartsWithEveryLoad) {
  runOutOfTime();
  const auto first = status().seconds;
  ASSERT_GT(first, 0.0);
  recorder_->forget();
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(reaches(SolveState::kTimeLimit));  // the used up time of the first scene did not count
  (void)sceneText();
  EXPECT_GT(status().shots, 0U);
  const auto progress = recorder_->progress();
  const auto begun = std::ranges::find_if(progress, [](const auto& s) { return s.state == SolveState::kSolving; });
  ASSERT_NE(begun, progress.end());
  EXPECT_EQ(begun->seconds, 0.0);
  EXPECT_EQ(begun->shots, 0U);
}

TEST_F(Settings, APausedSolveShootsNothingUntilItIsResumed) {
  ASSERT_TRUE(configure([](SolveSettings& s) { s.target_error = kNever; }));
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(eventually([&] { return status().shots > 0; }));
  ASSERT_EQ(pause().value(), SolveState::kPaused);
  const auto paused = status().shots;
  for (int i = 0; i < 20; ++i) (void)sceneText();
  EXPECT_EQ(pause().value(), SolveState::kPaused);
  EXPECT_EQ(status().shots, paused);
  EXPECT_EQ(resume().value(), SolveState::kSolving);
  EXPECT_TRUE(eventually([&] { return status().shots > paused; }));
}

TEST_F(Settings, ARestartWithTheSameSeedGivesTheSameBits) {
  solve(lumpedCube(0.5));
  const auto first = engine().lightmaps();
  const auto shots = status().shots;
  EXPECT_EQ(restart().value(), SolveState::kSolving);
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  EXPECT_EQ(status().shots, shots);
  const auto pixels = call<SharedBytes>(
      [&](auto done) { engine().lightmapExr(0, engine::Quantity::kIrradiance, {}, std::move(done)); });
  ASSERT_TRUE(configure([](SolveSettings& s) { s.seed = 2; }));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  const auto others = call<SharedBytes>(
      [&](auto done) { engine().lightmapExr(0, engine::Quantity::kIrradiance, {}, std::move(done)); });
  ASSERT_TRUE(configure([](SolveSettings& s) { s.seed = 1; }));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  const auto again = call<SharedBytes>(
      [&](auto done) { engine().lightmapExr(0, engine::Quantity::kIrradiance, {}, std::move(done)); });
  EXPECT_EQ(**pixels, **again);
  EXPECT_NE(**pixels, **others);
}

// The texel size decides, so that the layout, and with it every link, would stay.
TEST_F(Settings, AnotherSeedIsTakenAlsoWhereTexelsAreNamedWithIt) {
  ASSERT_TRUE(configure([](auto& settings) { settings.texel_size_m = 0.1; }));
  solve(lumpedCube(0.5));
  const auto light = [&] { return (void)sceneText(), meanIrradiance(*engine().lightmaps()); };
  const double first = light();
  ASSERT_TRUE(configure([](auto& settings) {
    settings.seed = 2;
    settings.texels = 20'000;
  }));
  ASSERT_TRUE(reaches(State::kConverged));
  const double second = light();
  ASSERT_TRUE(restart());
  ASSERT_TRUE(reaches(State::kConverged));
  EXPECT_EQ(second, light());
  EXPECT_NE(second, first);
}

TEST_F(Settings, MoreTexelsMakeANewLayoutOfTheSameRevision) {
  solve(lumpedCube(0.5));
  const auto before = status();
  const auto layout = engine().lightmaps()->layout;
  recorder_->forget();
  ASSERT_TRUE(configure([](SolveSettings& s) { s.texels = 1000; }));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  EXPECT_GT(status().patches, 2 * before.patches);
  EXPECT_EQ(status().revision, before.revision);
  EXPECT_GT(engine().lightmaps()->layout, layout);
  EXPECT_EQ(recorder_->loaded(), std::vector<std::uint64_t>{before.revision});
}

}  // namespace
}  // namespace radiosity::test
