// Texels that the engine chooses: as many as the error at the surface asks for, and no more than there may be.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::SolveSettings;
using engine::SolveState;
using test_scenes::lumpedCube;

constexpr std::uint64_t kMost = 6000;

class Adaptive : public EngineTest {
 protected:
  /// Solved, and what is left at the surface is known.
  [[nodiscard]] bool isMeasured() {
    const auto until = std::chrono::steady_clock::now() + kPatience;
    while (std::chrono::steady_clock::now() < until) {
      const auto now = status();
      if (now.surface_error && !now.probes_surface && now.state != SolveState::kSolving) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
    }
    return false;
  }
  void choose(double error, std::uint64_t most = kMost) {
    ASSERT_TRUE(configure([&](SolveSettings& settings) {
      settings.adaptive = true;
      settings.texels = most;
      settings.target_error = error;
    }));
  }
};

TEST_F(Adaptive, WithFixedTexelsTheErrorAtTheSurfaceIsToldOnceItIsMeasured) {
  solve(lumpedCube(0.5));
  ASSERT_TRUE(isMeasured());
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_GT(status().surface_error->total, 0.0);
  EXPECT_GE(status().surface_error->p95, 0.0);
}

TEST_F(Adaptive, AnEditOfLightMakesItUnknownUntilItIsMeasuredAgain) {
  solve(lumpedCube(0.5));
  ASSERT_TRUE(isMeasured());
  recorder_->forget();
  ASSERT_TRUE(call<engine::PatchOutcome>(
      [&](auto done) { engine().patch({.patch = emissionPatch(1, 2.0), .by = "test"}, done); }));
  ASSERT_TRUE(eventually([&] { return status().revision == 2 && status().surface_error; }));
  const auto told = recorder_->progress();
  ASSERT_FALSE(told.empty());
  EXPECT_FALSE(told.front().surface_error) << "that of the light before";
}

TEST_F(Adaptive, TheTargetIsMetAtTheSurface) {
  choose(kEasy);
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  ASSERT_TRUE(isMeasured());
  EXPECT_LE(status().surface_error->total, kEasy);
  EXPECT_LE(status().patches, kMost);
}

TEST_F(Adaptive, WhatNoTexelsCanReachSaysHowManyAreUsed) {
  choose(0.01, 300);
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(reaches(SolveState::kLimited));
  EXPECT_THAT(status().failure, testing::ContainsRegex("texels: [0-9]+ of 300 are used, .* would reach 1 %"));
  EXPECT_GT(status().surface_error->total, 0.01);
  EXPECT_LE(status().patches, 300U);
}

TEST_F(Adaptive, AnEditWhileTexelsAreChosenIsNotLost) {
  choose(kEasy);
  ASSERT_TRUE(load(lumpedCube(0.5)));
  const auto edited = call<engine::PatchOutcome>(
      [&](auto done) { engine().patch({.patch = emissionPatch(1, 2.0), .by = "test"}, done); });
  ASSERT_TRUE(edited);
  EXPECT_EQ(edited->revision, 2U);
  const auto edited_text = sceneText();
  ASSERT_TRUE(isMeasured());
  EXPECT_EQ(sceneText(), edited_text);
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_EQ(status().revision, 2U);
}

// What changes no light goes on with the solve: a layout of the document before must not bring that back.
TEST_F(Adaptive, ANameGivenWhileTexelsAreChosenIsNotLost) {
  choose(0.05);
  ASSERT_TRUE(load(lumpedCube(0.5)));
  for (std::uint64_t revision = 2; status().state == SolveState::kSolving && revision < 50; ++revision) {
    const auto patch = R"([{"op":"add","path":"/nodes/0/name","value":"named )" + std::to_string(revision) + R"("}])";
    ASSERT_TRUE(call<engine::PatchOutcome>([&](auto done) { engine().patch({.patch = patch, .by = "test"}, done); }));
    EXPECT_THAT(sceneText(), testing::HasSubstr("named " + std::to_string(revision)));
  }
  const auto last = sceneText();
  ASSERT_TRUE(isMeasured());
  EXPECT_EQ(sceneText(), last);
}

TEST_F(Adaptive, TimeThatIsPausedIsNoSolveTime) {
  constexpr double kPaused = 0.4;
  choose(0.05);
  const auto begin = std::chrono::steady_clock::now();
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(call<SolveState>([&](auto done) { engine().pause(done); }));
  std::this_thread::sleep_for(std::chrono::duration<double>(kPaused));
  ASSERT_TRUE(call<SolveState>([&](auto done) { engine().resume(done); }));
  ASSERT_TRUE(isMeasured());
  const std::chrono::duration<double> all = std::chrono::steady_clock::now() - begin;
  EXPECT_LE(status().seconds, all.count() - kPaused);
}

// A scene that is there already gets the texels that are wanted from then on, and only as long as they are.
TEST_F(Adaptive, ItCanBeAskedForAndNoMore) {
  solve(lumpedCube(0.5));
  const auto fixed = status().patches;
  choose(kEasy);
  ASSERT_TRUE(eventually([&] { return status().state == SolveState::kConverged && status().surface_error; }));
  EXPECT_NE(status().patches, fixed);
  EXPECT_LE(status().surface_error->total, kEasy);
  ASSERT_TRUE(configure([](SolveSettings& settings) {
    settings.adaptive = false;
    settings.texels = 150;
  }));
  ASSERT_TRUE(eventually([&] { return status().state == SolveState::kConverged; }));
  EXPECT_EQ(status().patches, fixed);
}

// It ends only once the last layout is measured, and says so where that is not good enough.
TEST_F(Adaptive, ATighterTargetIsMetAtTheSurfaceToo) {
  choose(0.2);  // single leaves of this transport are four times too bright, which alone leaves 12 to 14 %
  ASSERT_TRUE(load(lumpedCube(0.5)));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  choose(0.03);
  ASSERT_TRUE(eventually([&] { return status().state != SolveState::kSolving && !status().probes_surface; }));
  ASSERT_TRUE(status().surface_error);
  EXPECT_EQ(status().state == SolveState::kConverged, status().surface_error->total <= 0.03);
}

TEST_F(Adaptive, AnotherTargetWhileTexelsAreChosenIsTheOneThatHolds) {
  choose(0.03);
  ASSERT_TRUE(load(lumpedCube(0.5)));
  choose(kEasy);
  ASSERT_TRUE(eventually([&] { return status().state != SolveState::kSolving && status().surface_error; }));
  EXPECT_EQ(status().settings.target_error, kEasy);
  EXPECT_EQ(status().state, SolveState::kConverged);
}

// A layout that is young when the time is up must not take the place of one that was better.
TEST_F(Adaptive, TimeThatIsUpLeavesTheBetterOfTwoLayouts) {
  constexpr double kMeasured = 1.05;  // it is the same light, measured already
  choose(0.003, 8'000);
  ASSERT_TRUE(load(test_scenes::smallRoom()));
  double measured = 0.0;
  std::uint64_t pilot = 0;
  ASSERT_TRUE(eventually([&] {
    const auto now = status();
    if (now.surface_error && measured == 0.0) {
      measured = now.surface_error->total;
      pilot = now.patches;
    }
    return pilot > 0 && now.patches != pilot;
  }));
  ASSERT_TRUE(configure([](SolveSettings& settings) { settings.time_limit_s = 0.001; }));
  ASSERT_TRUE(reaches(SolveState::kTimeLimit));
  ASSERT_TRUE(isMeasured());
  EXPECT_LE(status().error.total, kMeasured * measured);
}

}  // namespace
}  // namespace radiosity::test
