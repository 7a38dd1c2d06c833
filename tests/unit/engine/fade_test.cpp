// What viewers see while geometry is solved anew: the light that was there, which fades into the new.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/block_room.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::SolveState;
using test_scenes::lumpedCube;

class Fade : public EngineTest {};

/// Mean of a page's covered texels would need coverage; a closed box has hardly any gutter.
double darkest(const std::vector<std::shared_ptr<const engine::Lightmaps>>& published) {
  double low = 1e30;
  for (const auto& lightmaps : published) low = std::min(low, meanIrradiance(*lightmaps));
  return low;
}

TEST_F(Fade, TheOldLightFadesIntoTheNewWithoutADarkMoment) {
  solve(blockRoom());
  const double before = meanIrradiance(*engine().lightmaps());
  ASSERT_GT(before, 0.0);
  recorder_->forget();
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/nodes/@block/translation","value":[0.7,0,0.7]}])"));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  const auto published = recorder_->lightmaps();
  ASSERT_FALSE(published.empty());
  EXPECT_EQ(published.front()->revision, 2U);
  // Nothing but the surroundings of the block changed: the mean may not leave the band of the two solves' errors.
  EXPECT_GT(darkest(published), 0.8 * before);
  EXPECT_TRUE(published.back()->final);
  // In the end it is the solver's own light, which a solve from nothing finds too.
  const auto shown = published.back()->pages.front()->mips.front().pixels;
  const double error = status().error.texels;
  ASSERT_TRUE(restart());
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  const auto solved = engine().lightmaps()->pages.front()->mips.front().pixels;
  ASSERT_EQ(solved.size(), shown.size());
  double difference = 0.0, all = 0.0;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    const glm::dvec3 d(solved[i] - shown[i]), v(solved[i]);
    difference += glm::dot(d, d);
    all += glm::dot(v, v);
  }
  EXPECT_LE(std::sqrt(difference / all), error + status().error.texels);
}

std::size_t tilesNewerThan(const engine::Lightmaps& lightmaps, std::uint64_t version) {
  std::size_t newer = 0;
  for (const auto& page : lightmaps.pages) {
    for (const auto& mip : page->tile_version)
      newer += static_cast<std::size_t>(std::ranges::count_if(mip, [&](auto v) { return v > version; }));
  }
  return newer;
}

TEST_F(Fade, AMovedNodeKeepsTheLayoutAndIsSentNoTileBeforeItsLightChanges) {
  solve(blockRoom());
  const auto before = engine().lightmaps();
  recorder_->forget();
  const auto uploads = script_->uploads.load();
  script_->run_fails = true;  // nothing is known of its light
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/nodes/@block/translation","value":[0.7,0,0.7]}])"));
  EXPECT_GT(script_->uploads, uploads) << "its geometry changed";
  ASSERT_TRUE(reaches(SolveState::kFailed));
  (void)sceneText();
  // Nothing was published before the end, which is: its pages would have been the same.
  ASSERT_EQ(recorder_->lightmaps().size(), 1U);
  EXPECT_EQ(recorder_->lightmaps().front()->layout, before->layout);
  EXPECT_EQ(tilesNewerThan(*engine().lightmaps(), before->tile_version), 0U);
  EXPECT_EQ(meanIrradiance(*engine().lightmaps()), meanIrradiance(*before));
  script_->run_fails = false;
  ASSERT_TRUE(restart());
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  EXPECT_GT(tilesNewerThan(*engine().lightmaps(), before->tile_version), 0U) << "a shadow has moved";
  EXPECT_EQ(engine().lightmaps()->layout, before->layout);
}

TEST_F(Fade, WhereTheLayoutChangesTheOldLightIsCarriedOver) {
  solve(blockRoom());
  const double before = meanIrradiance(*engine().lightmaps());
  recorder_->forget();
  script_->run_fails = true;  // nothing is known of the new
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/nodes/@block/scale","value":[0.9,0.9,0.9]}])"));
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/nodes/@block/translation","value":[0.7,0,0.7]}])"));
  ASSERT_TRUE(patch(emissionPatch(1, 20.0)));  // upon what is not solved
  ASSERT_TRUE(reaches(SolveState::kFailed));
  (void)sceneText();
  ASSERT_GE(recorder_->lightmaps().size(), 2U);
  // Texels of the block, and under it, are others; nothing is black.
  for (const auto& lightmaps : recorder_->lightmaps()) EXPECT_NEAR(meanIrradiance(*lightmaps), before, 0.1 * before);
  script_->run_fails = false;
  ASSERT_TRUE(restart());
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_NEAR(meanIrradiance(*engine().lightmaps()), 2.0 * before, 0.1 * before);
}

// Its pages are none, however often somebody asks for the light before.
TEST_F(Fade, AnEmptySceneOnTheWayIsNoEnd) {
  solve(blockRoom());
  ASSERT_TRUE(patch(R"([{"op":"add","path":"/extensionsUsed","value":["KHR_lights_punctual"]},
      {"op":"add","path":"/extensions",
       "value":{"KHR_lights_punctual":{"lights":[{"type":"point","color":[1,1,1],"intensity":100}]}}},
      {"op":"add","path":"/nodes/-",
       "value":{"translation":[1,1,1],"extensions":{"KHR_lights_punctual":{"light":0}}}},
      {"op":"add","path":"/scenes/0/nodes/-","value":4}])"));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  ASSERT_TRUE(restart());
  ASSERT_TRUE(pause());  // so that the light before is shown
  ASSERT_TRUE(patch(R"([{"op":"replace","path":"/scenes/0/nodes","value":[4]}])"));
  ASSERT_TRUE(undo());  // whose light before is that of the empty scene
  ASSERT_TRUE(resume());
  ASSERT_TRUE(reaches(SolveState::kConverged));
  EXPECT_GT(meanIrradiance(*engine().lightmaps()), 0.0);
}

TEST_F(Fade, WhatIsHiddenScaledOrAddedHasALayoutOfItsOwn) {
  solve(blockRoom());
  auto layout = engine().lightmaps()->layout;
  for (const char* edit :
       {R"({"op":"replace","path":"/nodes/@block/extensions/KHR_node_visibility/visible","value":false})",
        R"({"op":"replace","path":"/nodes/@block/extensions/KHR_node_visibility/visible","value":true})",
        R"({"op":"replace","path":"/nodes/@block/scale","value":[0.5,0.5,0.5]})",
        R"({"op":"replace","path":"/materials/@red/doubleSided","value":true})"}) {
    ASSERT_TRUE(patch("[" + std::string(edit) + "]")) << edit;
    (void)sceneText();
    EXPECT_GT(engine().lightmaps()->layout, layout) << edit;
    layout = engine().lightmaps()->layout;
  }
}

TEST_F(Fade, WhatIsNewIsNotBlackEither) {
  solve(lumpedCube(0.5));
  recorder_->forget();
  // A second cube, seen by nobody, with charts of its own: they have no old light.
  ASSERT_TRUE(patch(R"([{"op":"add","path":"/nodes/-","value":{"mesh":0,"scale":[0.1,0.1,0.1]}},
                        {"op":"add","path":"/scenes/0/nodes/-","value":2}])"));
  const auto first = recorder_->lightmaps();
  ASSERT_FALSE(first.empty());
  for (const auto& texel : first.front()->pages.front()->mips.front().pixels) EXPECT_GE(texel.x, 0.0F);
  EXPECT_GT(meanIrradiance(*first.front()), 0.0);
  ASSERT_TRUE(reaches(SolveState::kConverged));
}

/// As the server is: pages of the light before an edit are left out where its own follows soon.
class SolvedSoon : public EngineTest {
 protected:
  void startWith(std::chrono::milliseconds soon) {
    auto options = rayOptions(script_);
    options.solved_soon = soon;
    watching_.reset();
    engine_ = engine::makeEngine(std::move(options)).value();
    engine_->addListener(recorder_);
    watching_ = engine_->watch(engine::Quantity::kIrradiance);
    solve(lumpedCube(0.5));
    recorder_->forget();
  }
  /// Another cube, seen by nobody, with charts of its own.
  bool addCube(int node) {
    const auto name = std::to_string(node);
    return patch(R"([{"op":"add","path":"/nodes/-","value":{"mesh":0,"scale":[0.1,0.1,0.1]}},
                     {"op":"add","path":"/scenes/0/nodes/-","value":)" +
                 name + "}]")
        .has_value();
  }
};

TEST_F(SolvedSoon, ItsOwnLightAloneIsShown) {
  startWith(std::chrono::minutes(1));
  script_->pause_ms = 200;  // till there is light of its own
  ASSERT_TRUE(addCube(2));
  EXPECT_TRUE(recorder_->lightmaps().empty());
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();  // all that was told is told
  const auto published = recorder_->lightmaps();
  ASSERT_FALSE(published.empty());
  EXPECT_TRUE(published.back()->final);
  for (const auto& lightmaps : published) EXPECT_EQ(lightmaps->revision, status().revision);
}

TEST_F(SolvedSoon, WhatIsNotIsShownAsItWasMeanwhile) {
  startWith(std::chrono::milliseconds(20));
  script_->pause_ms = 60;
  ASSERT_TRUE(addCube(2));
  ASSERT_TRUE(reaches(SolveState::kConverged));
  (void)sceneText();
  const auto published = recorder_->lightmaps();
  ASSERT_GT(published.size(), 1U);
  EXPECT_FALSE(published.front()->final);
  EXPECT_GT(meanIrradiance(*published.front()), 0.0);
}

// Whoever drags something about sees all of it, though no edit is solved before the next.
TEST_F(SolvedSoon, TheNextEditShowsWhatTheOneBeforeOwes) {
  startWith(std::chrono::minutes(1));
  script_->pause_ms = 200;
  ASSERT_TRUE(addCube(2));
  EXPECT_TRUE(recorder_->lightmaps().empty());
  ASSERT_TRUE(addCube(3));
  (void)sceneText();
  EXPECT_FALSE(recorder_->lightmaps().empty());
  EXPECT_FALSE(recorder_->lightmaps().front()->final);
}

// Nothing else would show it.
TEST_F(SolvedSoon, APauseShowsWhatIsOwed) {
  startWith(std::chrono::minutes(1));
  script_->pause_ms = 200;
  ASSERT_TRUE(addCube(2));
  ASSERT_TRUE(pause());
  EXPECT_FALSE(recorder_->lightmaps().empty());
}

}  // namespace
}  // namespace radiosity::test
