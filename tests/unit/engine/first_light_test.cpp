// Scenes of many texels: what is shown of them before all texels are there, and that nothing else depends on it.
#include <gtest/gtest.h>

#include <algorithm>
#include <future>

#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::SolveState;
using test_scenes::lumpedCube;

constexpr std::uint64_t kFew = 60, kMany = 3000;

class FirstLight : public EngineTest {
 protected:
  void SetUp() override { start(kFew); }

  void start(std::uint64_t first_texels) {
    auto options = rayOptions(script_);
    options.settings.texels = kMany;
    options.first_light_above = 1000;
    options.first_texels = first_texels;
    auto made = engine::makeEngine(options);
    ASSERT_TRUE(made) << made.error().text();
    watching_.reset();
    recorder_ = std::make_shared<Recorder>();
    engine_ = std::move(*made);
    engine_->addListener(recorder_);
    watching_ = engine_->watch(engine::Quantity::kIrradiance);
  }

  static std::size_t texelsOf(const engine::Lightmaps& lightmaps) {
    std::size_t texels = 0;
    for (const auto& page : lightmaps.pages) texels += page->mips.front().pixels.size();
    return texels;
  }
};

TEST_F(FirstLight, IsShownOnFewTexelsAndThenOnAllOfThem) {
  solve(lumpedCube(0.5));
  EXPECT_EQ(recorder_->loaded(), (std::vector<std::uint64_t>{1, 1}));  // two layouts of one revision
  const auto shown = recorder_->lightmaps();
  ASSERT_GE(shown.size(), 2U);
  EXPECT_LT(texelsOf(*shown.front()), 10 * kFew);
  EXPECT_EQ(shown.front()->revision, 1U);
  EXPECT_GT(texelsOf(*shown.back()), kMany / 2);
  EXPECT_GT(shown.back()->layout, shown.front()->layout);
  EXPECT_GT(status().patches, kMany / 2);
  ASSERT_EQ(history().revisions.size(), 1U);
  EXPECT_EQ(history().revisions[0].by, "ann");
  // Whoever comes to the whole sees the light of the few until its own is as good.
  const auto whole = std::ranges::find_if(shown, [](const auto& maps) { return texelsOf(*maps) > kMany / 2; });
  ASSERT_NE(whole, shown.end());
  EXPECT_GT(meanIrradiance(**whole), 0.0);
}

TEST_F(FirstLight, IsNothingThatIsStatedOrWaitedFor) {
  solve(lumpedCube(0.5));
  bool loading = false;
  for (const auto& told : recorder_->progress()) {
    if (told.state != SolveState::kLoading) continue;
    loading |= told.revision == 1;
    EXPECT_EQ(told.error.total, 1.0);
    EXPECT_EQ(told.patches, 0U);
  }
  EXPECT_TRUE(loading);
}

TEST_F(FirstLight, LeavesNoTraceInTheResult) {
  solve(lumpedCube(0.5));
  const auto with = light();
  start(0);
  solve(lumpedCube(0.5));
  EXPECT_EQ(recorder_->loaded(), std::vector<std::uint64_t>{1});
  EXPECT_TRUE(light() == with);
}

TEST_F(FirstLight, AnEditOfASceneThatIsStillBeingLoadedWaitsForAllOfIt) {
  const auto bytes = std::make_shared<const Bytes>(test_scenes::encodeGlb(lumpedCube(0.5)));
  std::promise<Result<engine::LoadOutcome>> loaded;
  engine().loadBytes("cube.glb", bytes, "ann", [&](auto outcome) { loaded.set_value(std::move(outcome)); });
  const auto edited = patch(emissionPatch(0, 2.0));
  ASSERT_TRUE(edited) << edited.error().text();
  EXPECT_EQ(edited->revision, 2U);
  const auto outcome = loaded.get_future().get();
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->revision, 1U);
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_GT(status().patches, kMany / 2);
}

TEST_F(FirstLight, AWholeThatCannotBeHadLeavesNothing) {
  script_->uploads_until_failure = 2;
  const auto loaded = load(lumpedCube(0.5));
  ASSERT_FALSE(loaded);
  EXPECT_EQ(loaded.error().code, ErrorCode::kUnavailable);
  EXPECT_EQ(status().state, SolveState::kEmpty);
  EXPECT_EQ(patch("[]").error().code, ErrorCode::kNotFound);
  ASSERT_TRUE(engine().lightmaps());
  EXPECT_TRUE(engine().lightmaps()->pages.empty());
  EXPECT_TRUE(history().revisions.empty());
  solve(lumpedCube(0.5));
  EXPECT_EQ(status().revision, 2U);  // numbers that were told are not used again
}

TEST_F(FirstLight, ASecondSceneIsShownWhenAllOfItIsThere) {
  solve(lumpedCube(0.5));
  recorder_->forget();
  solve(lumpedCube(0.9));
  EXPECT_EQ(recorder_->loaded(), std::vector<std::uint64_t>{2});
}

TEST_F(FirstLight, IsWantedWhereTexelsAreSmallToo) {
  // Six square metres: 15,000 texels, and 24.
  ASSERT_TRUE(configure([](engine::SolveSettings& settings) { settings.texel_size_m = 0.02; }));
  solve(lumpedCube(0.5));
  EXPECT_EQ(recorder_->loaded().size(), 2U);
  start(kFew);
  ASSERT_TRUE(configure([](engine::SolveSettings& settings) { settings.texel_size_m = 0.5; }));
  solve(lumpedCube(0.5));
  EXPECT_EQ(recorder_->loaded().size(), 1U);
}

TEST_F(FirstLight, AnEngineMayEndWhileTheWholeIsBeingMade) {
  const auto bytes = std::make_shared<const Bytes>(test_scenes::encodeGlb(lumpedCube(0.5)));
  engine().loadBytes("cube.glb", bytes, "ann", [](const auto&) {});
  EXPECT_TRUE(eventually([&] { return !recorder_->loaded().empty(); }));
  watching_.reset();
  engine_.reset();
}

}  // namespace
}  // namespace radiosity::test
