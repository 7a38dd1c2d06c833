// From an empty engine to a solved scene, and what may go wrong on the way.
#include <gmock/gmock.h>

#include <algorithm>
#include <cmath>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::SolveState;
using test_scenes::lumpedCube;

class Lifecycle : public EngineTest {};

bool toldState(const Recorder& recorder, SolveState state) {
  return std::ranges::any_of(recorder.progress(), [&](const auto& status) { return status.state == state; });
}

TEST_F(Lifecycle, AnEngineWithoutASceneIsEmptyAndSaysSo) {
  EXPECT_EQ(status().state, SolveState::kEmpty);
  EXPECT_EQ(status().revision, 0U);
  EXPECT_EQ(status().gl_renderer, "rays");
  EXPECT_EQ(patch("[]").error().code, ErrorCode::kNotFound);
  EXPECT_EQ(restart().error().code, ErrorCode::kNotFound);
  EXPECT_EQ(pause().value(), SolveState::kEmpty);
  EXPECT_EQ(engine().lightmaps(), nullptr);
}

TEST_F(Lifecycle, ALoadedSceneIsSolvedToItsTarget) {
  solve(lumpedCube(0.5));
  EXPECT_EQ(recorder_->loaded(), std::vector<std::uint64_t>{1});
  for (const auto state : {SolveState::kLoading, SolveState::kSolving, SolveState::kConverged})
    EXPECT_TRUE(toldState(*recorder_, state)) << static_cast<int>(state);
  const auto now = status();
  EXPECT_EQ(now.revision, 1U);
  EXPECT_LE(now.error.texels, kEasy);
  EXPECT_EQ(now.surfaces, 6U);
  EXPECT_GT(now.shots, 0U);
  const auto lightmaps = engine().lightmaps();
  ASSERT_TRUE(lightmaps);
  EXPECT_TRUE(lightmaps->final);
  EXPECT_EQ(lightmaps->tile_version, now.tile_version);
  // The floor shines with 1 lux on five grey faces and, by one bounce and more, on itself: mean H = (1 + rho B) / ...
  // exactly: sum of H A = Phi / (1 - rho) with Phi = 1, over six faces.
  EXPECT_NEAR(meanIrradiance(*lightmaps), 2.0 / 6.0, 0.03);
}

TEST_F(Lifecycle, WhoFetchesTheSceneAtTheSameTimeSharesIt) {
  solve(lumpedCube(0.5));
  const auto fetch = [&] {
    return call<SharedBytes>([&](auto done) { engine().sceneGlb({}, {}, std::move(done)); }).value();
  };
  const auto first = fetch();
  EXPECT_EQ(fetch(), first);
  ASSERT_TRUE(patch(emissionPatch(1, 2.0)));
  const auto second = fetch();
  EXPECT_NE(*second, *first);
  EXPECT_EQ(fetch(), second);
}

TEST_F(Lifecycle, EnergyIsAccountedForToTheLastLumen) {
  solve(lumpedCube(0.5));
  const auto energy = status().energy;
  EXPECT_NEAR(energy.emitted, 1.0, 1e-4);  // white: 1 lux x 1 m2
  const double found =
      energy.absorbed + energy.specular + energy.escaped + energy.backface + energy.unshot + energy.imbalance;
  EXPECT_NEAR(found / energy.emitted, 1.0, 1e-5);
  EXPECT_FALSE(status().counters.contains("energy.imbalance"));
}

TEST_F(Lifecycle, EveryLoadRaisesRevisionAndLayout) {
  solve(lumpedCube(0.5));
  const auto before = engine().lightmaps();
  EXPECT_EQ(load(lumpedCube(0.2)).value().revision, 2U);
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  EXPECT_EQ(status().revision, 2U);
  EXPECT_GT(engine().lightmaps()->layout, before->layout);
  EXPECT_EQ(engine().lightmaps()->revision, 2U);
}

TEST_F(Lifecycle, WhatRenderersTakeOfASceneIsPreparedByTheLoadAlone) {
  solve(lumpedCube(0.5));
  ASSERT_TRUE(load(lumpedCube(0.2)));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_EQ(script_->prepared, 2);
  EXPECT_EQ(script_->prepared_here, 0);
}

TEST_F(Lifecycle, BytesThatAreNoSceneLeaveTheOldOneAsItWas) {
  solve(lumpedCube(0.5));
  const auto before = status();
  const auto uploads = script_->uploads.load();
  const auto refused = call<engine::LoadOutcome>([&](auto done) {
    engine().loadBytes("junk.glb", std::make_shared<const Bytes>(Bytes{'j', 'u', 'n', 'k'}), {}, std::move(done));
  });
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().text(), testing::HasSubstr("junk.glb"));
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_EQ(status().revision, before.revision);
  EXPECT_EQ(status().shots, before.shots);
  EXPECT_EQ(script_->uploads, uploads);
}

TEST_F(Lifecycle, ATransportThatCannotStartEndsStartUpWithItsReason) {
  auto options = rayOptions(script_);
  options.make_transport = []() -> Result<std::unique_ptr<solver::Transport>> {
    return fail(ErrorCode::kUnavailable, "no EGL driver");
  };
  const auto made = engine::makeEngine(std::move(options));
  ASSERT_FALSE(made);
  EXPECT_EQ(made.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(made.error().message, "no EGL driver");
}

TEST_F(Lifecycle, AFailingTransportStopsTheSolveWithItsReasonAndALoadRecovers) {
  script_->run_fails = true;
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(reaches(SolveState::kFailed));
  EXPECT_THAT(status().failure, testing::HasSubstr("the device was lost"));
  script_->run_fails = false;
  solve(lumpedCube(0.5));
  EXPECT_EQ(status().failure, "");
  EXPECT_NEAR(meanIrradiance(*engine().lightmaps()), 2.0 / 6.0, 0.03);
}

TEST_F(Lifecycle, AfterAFailureAnEditOfALampLosesNoLight) {
  script_->run_fails = true;
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(reaches(SolveState::kFailed));
  script_->run_fails = false;
  ASSERT_TRUE(patch(emissionPatch(1, 2.0 / 3.14159265)));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  EXPECT_NEAR(meanIrradiance(*engine().lightmaps()), 4.0 / 6.0, 0.06);
}

TEST_F(Lifecycle, AFailedUploadLetsTheOldSceneGoOn) {
  solve(lumpedCube(0.5));
  script_->uploads_to_fail = 1;
  EXPECT_EQ(load(lumpedCube(0.2)).error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_EQ(status().revision, 1U);
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kEasy / 2; }));
  EXPECT_TRUE(reaches(SolveState::kConverged));
}

TEST_F(Lifecycle, ATransportThatTakesNoSceneAtAllIsAFailureThatALoadRecovers) {
  solve(lumpedCube(0.5));
  script_->uploads_to_fail = 2;  // the new scene, and the old one again
  EXPECT_FALSE(load(lumpedCube(0.2)));
  EXPECT_EQ(status().state, SolveState::kFailed);
  EXPECT_EQ(status().failure, "out of memory on the device");
  solve(lumpedCube(0.2));
  EXPECT_EQ(status().revision, 2U);
}

TEST_F(Lifecycle, AFullQueueAnswersBusyAndForgetsNothingElse) {
  constexpr int kAsked = 2000;
  std::promise<void> entered, go_on;
  engine().pause([&](const Result<SolveState>&) {
    entered.set_value();
    go_on.get_future().wait();
  });
  entered.get_future().wait();
  int busy = 0;  // answered at once, by this thread
  std::atomic<int> done{0};
  for (int i = 0; i < kAsked; ++i) {
    engine().pause([&](const Result<SolveState>& state) {
      if (state) {
        ++done;
      } else if (state.error().code == ErrorCode::kBusy) {
        ++busy;
      }
    });
  }
  EXPECT_GT(busy, 0);
  EXPECT_EQ(done, 0);
  go_on.set_value();
  EXPECT_TRUE(eventually([&] { return done + busy == kAsked; }));
  EXPECT_TRUE(pause());
}

TEST_F(Lifecycle, AnEngineMayBeDestroyedInTheMiddleOfASolve) {
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kNever; }));
  ASSERT_TRUE(load(lumpedCube(0.5)));
  for (int i = 0; i < 10; ++i) engine().restart([](const Result<SolveState>&) {});
  engine_.reset();
}

TEST_F(Lifecycle, ALateWatcherFindsWhatWasSolvedBeforeItCame) {
  watching_.reset();
  solve(lumpedCube(0.5));
  EXPECT_EQ(engine().lightmaps(), nullptr);  // nobody was there to see
  watching_ = engine().watch(engine::Quantity::kIrradiance);
  ASSERT_TRUE(eventually([&] { return recorder_->lightmaps().size() == 1; }));
  EXPECT_TRUE(recorder_->lightmaps()[0]->final);
}

}  // namespace
}  // namespace radiosity::test
