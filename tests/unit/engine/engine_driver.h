// The engine with a ray caster in place of OpenGL, and the means to ask it things from a test's thread.
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <cstddef>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "server/engine/loop/solve_loop.h"
#include "tests/scenes/scene.h"

namespace radiosity::test {

/// What a test decides about the transport while the solve thread uses it.
struct TransportScript {
  std::atomic<bool> run_fails{false};
  std::atomic<int> runs_until_failure{0};  ///< the run that brings it from 1 to 0 fails
  std::atomic<int> losses{0};
  std::atomic<int> idle_missing{0};  ///< of two renderers
  std::atomic<int> replacements_to_fail{0};
  std::atomic<int> replacements{0};           ///< tried
  std::atomic<int> uploads_until_failure{0};  ///< likewise
  std::atomic<int> uploads_to_fail{0}, uploads_to_run_out{0};
  std::atomic<bool> runs_out_of_memory{false};
  std::atomic<int> uploads{0};
  std::atomic<bool> takes_scenes{true};            ///< false: renderers are still at the last one
  std::atomic<int> pause_ms{0};                    ///< with each run, as a slow renderer would
  std::atomic<bool> puts_off{false};               ///< every run, as those do that never come to an end
  std::atomic<int> prepared{0}, prepared_here{0};  ///< scenes, and by the thread that runs
};

/// Everything a listener is told, in order.
class Recorder final : public engine::Listener {
 public:
  void onProgress(const engine::Status& status) override;
  void onScenePatched(std::uint64_t revision, const std::string& patch, const std::string& by) override;
  void onSceneLoaded(std::uint64_t revision) override;
  void onLightmaps(const std::shared_ptr<const engine::Lightmaps>& lightmaps) override;

  void onNotice(const engine::Notice& notice) override;

  struct Patched {
    std::uint64_t revision = 0;
    std::string patch, by;
  };
  [[nodiscard]] std::vector<engine::Status> progress() const;
  [[nodiscard]] std::vector<Patched> patched() const;
  [[nodiscard]] std::vector<std::uint64_t> loaded() const;
  [[nodiscard]] std::vector<std::shared_ptr<const engine::Lightmaps>> lightmaps() const;
  [[nodiscard]] std::vector<engine::Notice> notices() const;
  void forget();

 private:
  mutable std::mutex mutex_;
  std::vector<engine::Status> progress_;
  std::vector<Patched> patched_;
  std::vector<std::uint64_t> loaded_;
  std::vector<std::shared_ptr<const engine::Lightmaps>> lightmaps_;
  std::vector<engine::Notice> notices_;
};

/// A target that these small scenes reach in well under a second; and one that they never reach.
inline constexpr double kEasy = 0.2, kNever = 1e-9;
/// Of a cube with the options of EngineTest: six faces of 1 m2 and 5 x 5 texels.
inline constexpr std::size_t kCubeTexels = 150;

class EngineTest : public testing::Test {
 protected:
  using State = engine::SolveState;

  void SetUp() override;
  void TearDown() override { engine_.reset(); }
  /// An engine that keeps all in this folder, or goes on from there.
  void startOn(const std::string& folder, engine::EngineOptions options);

  /// Asks and waits for the answer: call<LoadOutcome>([&](auto done) { engine().loadBytes("a.glb", bytes, done); }).
  template <typename T, typename Ask>
  Result<T> call(Ask ask) {
    auto promise = std::make_shared<std::promise<Result<T>>>();
    auto answer = promise->get_future();
    ask([promise](Result<T> result) { promise->set_value(std::move(result)); });
    if (answer.wait_for(kPatience) != std::future_status::ready)
      return fail(ErrorCode::kInternal, "the engine did not answer");
    return answer.get();
  }

  Result<engine::LoadOutcome> load(const test_scenes::TestScene& scene);
  Result<engine::PatchOutcome> patch(engine::PatchRequest request);
  Result<engine::PatchOutcome> patch(std::string json) { return patch({.patch = std::move(json), .by = "test"}); }
  Result<engine::PatchOutcome> step(engine::StepRequest request);
  Result<engine::PatchOutcome> undo() { return step({false, {}, "undoer"}); }
  Result<engine::PatchOutcome> redo() { return step({true, {}, "redoer"}); }
  engine::HistoryReport history();
  Result<engine::SolveSettings> configure(const std::function<void(engine::SolveSettings&)>& change);
  Result<State> pause();
  Result<State> resume();
  Result<State> restart();
  /// Returns when everything asked before has been done.
  std::string sceneText();
  /// The light of all pages as files: published tiles keep what has changed by less than a quantum since they were
  /// last sent, and that depends on time.
  Bytes light();

  /// Waits until `holds()`; false: it never did.
  template <typename Condition>
  [[nodiscard]] bool eventually(const Condition& holds) {
    const auto deadline = std::chrono::steady_clock::now() + kPatience;
    while (!holds()) {
      if (std::chrono::steady_clock::now() > deadline) return false;
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
    return true;
  }
  /// Waits for the state; false: another state that lasts came instead.
  [[nodiscard]] testing::AssertionResult reaches(State state);
  /// Loads and waits for the target error.
  void solve(const test_scenes::TestScene& scene);

  [[nodiscard]] engine::Engine& engine() { return *engine_; }
  [[nodiscard]] engine::Status status() const { return engine_->status(); }

  /// A minute, times RADIOSITY_TEST_PATIENCE where that is set, as it is where a sanitizer makes all slower.
  static const std::chrono::seconds kPatience;
  std::shared_ptr<TransportScript> script_ = std::make_shared<TransportScript>();
  std::shared_ptr<Recorder> recorder_ = std::make_shared<Recorder>();
  std::unique_ptr<engine::Engine> engine_;
  std::shared_ptr<void> watching_;  ///< irradiance
};

/// Options for an engine that casts rays as `script` says.
[[nodiscard]] engine::EngineOptions rayOptions(std::shared_ptr<TransportScript> script);

/// Patch that gives material `index` the luminance `nits`.
[[nodiscard]] std::string emissionPatch(int index, double nits);

/// Mean of all texels of all pages.
[[nodiscard]] double meanIrradiance(const engine::Lightmaps& lightmaps);

}  // namespace radiosity::test
