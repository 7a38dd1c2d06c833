// Loads that are called off, and what goes on beside a load: edits, questions, files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <future>
#include <stop_token>

#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::SolveState;
using test_scenes::lumpedCube;
using Loaded = std::future<Result<engine::LoadOutcome>>;

/// Far above the fifth of a second in which work ends on an idle machine, and far below what the load takes.
constexpr auto kSoon = std::chrono::seconds(4);

/// A cube with a floor of cells x cells quads, no two of one plane: seconds to load.
test_scenes::TestScene slowScene(int cells = 300) {
  auto scene = lumpedCube(0.5);
  scene.name = "slow";
  auto& floor = scene.objects.emplace_back();
  floor.name = "floor";
  const auto at = [&](int x, int z) {
    return glm::dvec3(x, 0.3 * std::sin(0.7 * x) * std::cos(0.9 * z) - 3.0 * cells, z) / (2.0 * cells);
  };
  for (int z = 0; z < cells; ++z)
    for (int x = 0; x < cells; ++x) floor.polygons.push_back({{at(x, z), at(x, z + 1), at(x + 1, z)}, 0, {}});
  return scene;
}

class Cancel : public EngineTest {
 protected:
  Loaded beginLoad(const engine::Client& client = {}) {
    static const auto kBytes = std::make_shared<const Bytes>(test_scenes::encodeGlb(slowScene()));
    const auto promise = std::make_shared<std::promise<Result<engine::LoadOutcome>>>();
    engine().loadBytes("slow.glb", kBytes, client, [promise](auto outcome) { promise->set_value(std::move(outcome)); });
    return promise->get_future();
  }
  /// Waits until a load is under way.
  [[nodiscard]] bool isUnderWay() {
    return eventually([&] { return status().load_fraction.value_or(0.0) > 0.05; });
  }
  static ErrorCode codeOf(Loaded& loaded) {
    if (loaded.wait_for(kSoon) != std::future_status::ready) return ErrorCode::kInternal;
    const auto outcome = loaded.get();
    return outcome ? ErrorCode::kInternal : outcome.error().code;
  }
};

TEST_F(Cancel, ALoadEndsWhenItsClientGoesAndTheSceneBeforeStays) {
  solve(lumpedCube(0.5));
  const auto before = status();
  std::stop_source gone;
  auto loaded = beginLoad({"ann", 1, gone.get_token()});
  ASSERT_TRUE(isUnderWay());
  gone.request_stop();
  EXPECT_EQ(codeOf(loaded), ErrorCode::kCancelled);
  EXPECT_EQ(status().state, SolveState::kConverged);
  EXPECT_FALSE(status().load_fraction.has_value());
  EXPECT_EQ(status().revision, before.revision);
  EXPECT_EQ(status().shots, before.shots);
  EXPECT_EQ(history().revisions.size(), 1U);
  EXPECT_EQ(load(lumpedCube(0.2)).value().revision, 2U);
}

TEST_F(Cancel, WithoutASceneBeforeThereIsNone) {
  std::stop_source gone;
  auto loaded = beginLoad({"ann", 1, gone.get_token()});
  ASSERT_TRUE(isUnderWay());
  auto waits = std::async(std::launch::async, [&] { return patch("[]"); });
  gone.request_stop();
  EXPECT_EQ(codeOf(loaded), ErrorCode::kCancelled);
  EXPECT_EQ(status().state, SolveState::kEmpty);
  EXPECT_EQ(waits.get().error().code, ErrorCode::kNotFound) << "what waited for the load is answered";
}

TEST_F(Cancel, AClientThatHasGoneBeforeItsTurnLoadsNothing) {
  std::stop_source gone;
  gone.request_stop();
  auto loaded = beginLoad({"ann", 1, gone.get_token()});
  EXPECT_EQ(codeOf(loaded), ErrorCode::kCancelled);
}

TEST_F(Cancel, ALoadEndsWhenAnotherComes) {
  auto first = beginLoad();
  ASSERT_TRUE(isUnderWay());
  const auto second = load(lumpedCube(0.5));
  ASSERT_TRUE(second) << second.error().text();
  EXPECT_EQ(second->revision, 1U);
  EXPECT_EQ(codeOf(first), ErrorCode::kCancelled);
  EXPECT_EQ(recorder_->loaded(), std::vector<std::uint64_t>{1});
}

TEST_F(Cancel, CallingOffEndsTheLoadAndRefusesOthers) {
  auto loaded = beginLoad();
  ASSERT_TRUE(isUnderWay());
  engine().callOff();
  EXPECT_EQ(codeOf(loaded), ErrorCode::kCancelled);
  EXPECT_EQ(load(lumpedCube(0.5)).error().code, ErrorCode::kCancelled);
}

TEST_F(Cancel, AnEngineEndsInTheMiddleOfALoad) {
  (void)beginLoad();
  ASSERT_TRUE(isUnderWay());
  watching_.reset();
  const auto begin = std::chrono::steady_clock::now();
  engine_.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, kSoon);
}

TEST_F(Cancel, TheSceneBeforeIsEditedAndSolvedBesideALoad) {
  solve(lumpedCube(0.5));
  std::stop_source gone;
  auto loaded = beginLoad({"ann", 1, gone.get_token()});
  ASSERT_TRUE(isUnderWay());
  const auto before = meanIrradiance(*engine().lightmaps());
  engine::PatchRequest request{.patch = emissionPatch(0, 2.0), .by = "ben"};
  request.session = 2;
  const auto edited = patch(std::move(request));
  ASSERT_TRUE(edited) << edited.error().text();
  EXPECT_EQ(edited->revision, 2U);
  EXPECT_TRUE(eventually([&] { return meanIrradiance(*engine().lightmaps()) > 1.9 * before; }));
  EXPECT_EQ(loaded.wait_for(std::chrono::seconds(0)), std::future_status::timeout);
  gone.request_stop();
  EXPECT_EQ(codeOf(loaded), ErrorCode::kCancelled);
  EXPECT_TRUE(reaches(SolveState::kConverged));
  EXPECT_EQ(status().revision, 2U);
  EXPECT_TRUE(undo());
}

/// Edits of light, of geometry, and back again, all of which end before the load does.
TEST_F(Cancel, NoEditWaitsForRenderersToTakeInALoad) {
  solve(lumpedCube(0.5));
  const auto move = [](double y) {
    return R"([{"op":"replace","path":"/nodes/0/translation","value":[0,)" + std::to_string(y) + ",0]}]";
  };
  script_->takes_scenes = false;
  const int before = script_->uploads;
  auto loaded = beginLoad();
  ASSERT_TRUE(eventually([&] { return script_->uploads > before; }));
  ASSERT_TRUE(patch(emissionPatch(0, 5.0)));
  ASSERT_TRUE(patch(move(0.25)));
  EXPECT_EQ(undo().value().revision, 4U);
  EXPECT_EQ(script_->uploads, before + 1) << "renderers are busy";
  EXPECT_EQ(status().state, SolveState::kLoading);
  EXPECT_NE(loaded.wait_for(std::chrono::seconds(0)), std::future_status::ready);
  script_->takes_scenes = true;
  const auto outcome = loaded.get();
  ASSERT_TRUE(outcome) << outcome.error().text();
  EXPECT_EQ(outcome->revision, 5U);
  EXPECT_TRUE(eventually([&] { return status().shots > 0; })) << "it is solved";
}

TEST_F(Cancel, ALoadThatRenderersTakeInGivesWayToTheSceneBefore) {
  solve(lumpedCube(0.5));
  script_->takes_scenes = false;
  const int before = script_->uploads;
  std::stop_source gone;
  auto loaded = beginLoad({"ann", 1, gone.get_token()});
  ASSERT_TRUE(eventually([&] { return script_->uploads > before; }));
  ASSERT_TRUE(patch(emissionPatch(0, 5.0)));
  gone.request_stop();
  EXPECT_EQ(codeOf(loaded), ErrorCode::kCancelled);
  EXPECT_EQ(script_->uploads, before + 2) << "they have the scene before again";
  EXPECT_TRUE(reaches(State::kConverged));
}

TEST_F(Cancel, AnEditByTheSessionThatLoadsIsOfItsNewScene) {
  solve(lumpedCube(0.5));
  const auto bytes = std::make_shared<const Bytes>(test_scenes::encodeGlb(slowScene(60)));
  std::promise<Result<engine::LoadOutcome>> loaded;
  engine().loadBytes("slow.glb", bytes, {"ann", 1, {}}, [&](auto outcome) { loaded.set_value(std::move(outcome)); });
  engine::PatchRequest request{.patch = R"([{"op":"test","path":"/nodes/1/name","value":"floor"}])", .by = "ann"};
  request.session = 1;
  const auto edited = patch(std::move(request));
  ASSERT_TRUE(edited) << edited.error().text();
  EXPECT_EQ(edited->revision, 3U);
  EXPECT_EQ(loaded.get_future().get().value().revision, 2U);
}

TEST_F(Cancel, SettingsWaitForALoad) {
  auto loaded = beginLoad();
  ASSERT_TRUE(isUnderWay());
  auto set = std::async(std::launch::async,
                        [&] { return configure([](engine::SolveSettings& settings) { settings.seed = 7; }); });
  engine().callOff();
  EXPECT_EQ(codeOf(loaded), ErrorCode::kCancelled);
  EXPECT_EQ(set.get().value().seed, 7U);
}

TEST_F(Cancel, ListenersAreToldHowFarALoadIs) {
  auto loaded = beginLoad();
  ASSERT_EQ(loaded.wait_for(kPatience), std::future_status::ready);
  ASSERT_TRUE(loaded.get());
  double last = -1.0;
  int told = 0;
  for (const auto& progress : recorder_->progress()) {
    EXPECT_EQ(progress.load_fraction.has_value(), progress.state == SolveState::kLoading);
    if (!progress.load_fraction) continue;
    EXPECT_GE(*progress.load_fraction, last);
    EXPECT_LE(*progress.load_fraction, 1.0);
    told += *progress.load_fraction > last ? 1 : 0;
    last = *progress.load_fraction;
  }
  EXPECT_GE(told, 4);
  EXPECT_GT(last, 0.5);
}

TEST_F(Cancel, FilesOfAClientThatHasGoneAreNotMade) {
  solve(lumpedCube(0.5));
  std::stop_source gone;
  gone.request_stop();
  const engine::Client client{"ann", 1, gone.get_token()};
  const auto glb = call<SharedBytes>([&](auto done) { engine().sceneGlb({}, client, std::move(done)); });
  EXPECT_EQ(glb.error().code, ErrorCode::kCancelled);
  EXPECT_TRUE(call<SharedBytes>([&](auto done) { engine().sceneGlb({}, {}, std::move(done)); }));
}

}  // namespace
}  // namespace radiosity::test
