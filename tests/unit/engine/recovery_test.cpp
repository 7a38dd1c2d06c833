// A transport that fails in the middle of a solve.
#include <gmock/gmock.h>

#include <algorithm>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::Notice;
using engine::SolveState;
using test_scenes::lumpedCube;

class Recovery : public EngineTest {};

TEST_F(Recovery, ALostRendererRestartsTheSolveAndTheResultHasTheSameBits) {
  solve(lumpedCube(0.5));
  const auto undisturbed = light();
  const auto shots = status().shots;
  recorder_->forget();

  script_->runs_until_failure = 3;
  solve(lumpedCube(0.5));
  EXPECT_EQ(script_->runs_until_failure, 0) << "the solve was too short to be disturbed";
  EXPECT_TRUE(light() == undisturbed);
  EXPECT_EQ(status().shots, shots);

  const auto notices = recorder_->notices();
  ASSERT_EQ(notices.size(), 1U);
  EXPECT_EQ(notices[0].kind, Notice::Kind::kSolveRestarted);
  EXPECT_THAT(notices[0].text, testing::HasSubstr("the driver reset the card"));
  EXPECT_EQ(status().solve_restarts, 1U);
  EXPECT_FALSE(status().renderer_lost);
  EXPECT_EQ(status().failure, "");
  EXPECT_TRUE(std::ranges::any_of(recorder_->progress(), [](const auto& told) {
    return told.renderer_lost && told.state == SolveState::kSolving;
  }));
}

TEST_F(Recovery, AnUploadThatFailsWhileRecoveringIsTriedAgain) {
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kNever; }));
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(pause());
  script_->uploads_to_fail = 2;
  script_->runs_until_failure = 1;
  ASSERT_TRUE(resume());
  EXPECT_TRUE(eventually([&] { return status().solve_restarts == 1; }));
  EXPECT_EQ(script_->uploads_to_fail, 0);
  ASSERT_TRUE(configure([](auto& settings) { settings.target_error = kEasy; }));
  EXPECT_TRUE(reaches(SolveState::kConverged));
}

TEST_F(Recovery, ARendererThatNeverComesBackEndsTheSolveAfterFourTries) {
  script_->run_fails = true;
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(reaches(SolveState::kFailed));
  EXPECT_EQ(status().solve_restarts, 4U);
  script_->run_fails = false;
  ASSERT_TRUE(restart());
  EXPECT_TRUE(reaches(SolveState::kConverged));
}

TEST_F(Recovery, WhatMemoryDoesNotSufficeForIsRefusedAndTheSceneStays) {
  solve(lumpedCube(0.5));
  const auto before = status();
  script_->uploads_to_run_out = 1;
  const auto loaded = load(lumpedCube(0.25));
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().code, ErrorCode::kTooLarge);
  script_->uploads_to_run_out = 1;
  const auto sized = configure([](auto& settings) { settings.texels = 600; });
  ASSERT_FALSE(sized);
  EXPECT_EQ(sized.error().code, ErrorCode::kTooLarge);
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_EQ(status().revision, before.revision);
  EXPECT_EQ(status().settings.texels, before.settings.texels);
  EXPECT_EQ(status().shots, before.shots);
  ASSERT_TRUE(patch(emissionPatch(0, 2.0)));
  EXPECT_TRUE(reaches(SolveState::kConverged));
}

TEST_F(Recovery, ASolveThatRunsOutOfMemoryFailsAndCanBeStartedAgain) {
  script_->runs_out_of_memory = true;
  ASSERT_TRUE(configure([](auto& settings) { settings.method = Method::kPaper; }));
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(reaches(SolveState::kFailed));
  EXPECT_THAT(status().failure, testing::HasSubstr("memory"));
  script_->runs_out_of_memory = false;
  ASSERT_TRUE(restart());
  EXPECT_TRUE(eventually([&] { return status().shots > 0; }));
}

TEST_F(Recovery, ReplacedRenderersAreTold) {
  script_->losses = 2;
  solve(lumpedCube(0.5));
  const auto notices = recorder_->notices();
  ASSERT_EQ(notices.size(), 1U);
  EXPECT_EQ(notices[0].kind, Notice::Kind::kRendererReplaced);
  EXPECT_THAT(notices[0].text, testing::HasSubstr("worker 7 hangs"));
  EXPECT_EQ(status().renderers_replaced, 2U);
}

// While nobody asks for anything.
TEST_F(Recovery, IdleRenderersThatDiedAreToldOfAndReplaced) {
  solve(lumpedCube(0.5));
  EXPECT_EQ(status().renderers, 2U);
  EXPECT_EQ(status().renderers_missing, 0U);
  recorder_->forget();
  script_->idle_missing = 2;
  ASSERT_TRUE(eventually([&] { return status().renderers_replaced == 2; }));
  EXPECT_TRUE(eventually([&] { return status().renderers_missing == 0; }));
  EXPECT_EQ(status().renderer_trouble, "");
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_TRUE(std::ranges::any_of(recorder_->progress(), [](const auto& told) {
    return told.renderers_missing == 2 && told.renderer_trouble == "worker 8 was killed by signal 9";
  }));
  const auto notices = recorder_->notices();
  ASSERT_EQ(notices.size(), 1U);
  EXPECT_EQ(notices[0].kind, Notice::Kind::kRendererReplaced);
}

TEST_F(Recovery, IdleRenderersThatCannotBeReplacedAreTriedAgain) {
  solve(lumpedCube(0.5));
  script_->replacements_to_fail = 1;
  script_->idle_missing = 1;
  EXPECT_TRUE(eventually([&] { return status().renderers_replaced == 1; }));
  EXPECT_EQ(script_->replacements, 2);
  EXPECT_TRUE(eventually([&] { return status().renderers_missing == 0; }));
}

TEST_F(Recovery, AnIdleEngineIsNotBusy) {
  solve(lumpedCube(0.5));
  (void)sceneText();
  EXPECT_TRUE(eventually([&] { return engine().busySeconds() == 0.0; }));
}

}  // namespace
}  // namespace radiosity::test
