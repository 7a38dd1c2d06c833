// The class behind makeEngine (solve_loop.h), private to this folder. Its methods lie in four files: solve_loop.cpp
// runs the thread, solve_loop_edits.cpp changes scene and settings, solve_loop_answers.cpp makes what can be fetched,
// solve_loop_publish.cpp shows lightmaps to those who watch.
#pragma once

#include <array>
#include <chrono>
#include <cstdint>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>

#include "server/engine/command_queue.h"
#include "server/engine/engine.h"
#include "server/engine/history.h"
#include "server/engine/listeners.h"
#include "server/engine/lit_scene.h"
#include "server/engine/publisher.h"
#include "server/engine/solve_loop.h"
#include "server/engine/watches.h"
#include "server/gpu/view_renderer.h"
#include "server/scene/document.h"
#include "server/solver/transport.h"

namespace radiosity::engine {

class SolveLoop final : public Engine {
 public:
  explicit SolveLoop(EngineOptions options);
  ~SolveLoop() override;
  SolveLoop(const SolveLoop&) = delete;
  SolveLoop& operator=(const SolveLoop&) = delete;

  /// Starts the thread and the transport; returns when both are up.
  [[nodiscard]] Result<void> start();

  void loadBytes(std::string name, SharedBytes bytes, Callback<LoadOutcome> done) override;
  void loadFile(std::string path, Callback<LoadOutcome> done) override;
  void patch(PatchRequest request, Callback<PatchOutcome> done) override;
  void step(StepRequest request, Callback<PatchOutcome> done) override;
  void history(Callback<HistoryReport> done) override;
  void configure(SolveSettings settings, Callback<SolveSettings> done) override;
  void pause(Callback<SolveState> done) override;
  void resume(Callback<SolveState> done) override;
  void restart(Callback<SolveState> done) override;
  [[nodiscard]] Status status() const override;
  [[nodiscard]] std::shared_ptr<void> watch(Quantity quantity) override;
  [[nodiscard]] std::shared_ptr<const Lightmaps> lightmaps(Quantity quantity) const override;
  void sceneText(Callback<SceneText> done) override;
  void sceneGlb(Callback<SharedBytes> done) override;
  void unlitGlb(Callback<SharedBytes> done) override;
  void lightmapExr(std::uint32_t page, Quantity quantity, Callback<SharedBytes> done) override;
  void snapshot(SnapshotRequest request, Callback<SharedBytes> done) override;
  void addListener(std::weak_ptr<Listener> listener) override;

 private:
  using Clock = std::chrono::steady_clock;

  /// Runs `work` on the solve thread and hands its Result to `done`; answers kBusy at once when the queue is full.
  template <typename T, typename Work>
  void ask(Callback<T> done, Work work);
  /// The same; answers kNotFound while no scene is loaded.
  template <typename T, typename Work>
  void askLit(Callback<T> done, Work work);

  // All below: solve thread only.
  void threadMain(std::promise<Result<void>> started);
  [[nodiscard]] bool runCommands();
  void solveSlice();
  void tellProgress(bool assess);  ///< not oftener than anyone can see; `assess`: with a new error
  /// The clock starts over: another scene, another seed, an edit. A paused solve stays paused.
  void beginSolve();
  void endSolve(SolveState state);
  /// What is watched and not published yet; `final`: as a new version in any case.
  void publishLightmaps(bool final);
  [[nodiscard]] QuantityPages pagesToShow(Quantity quantity);
  void publishQuantity(Quantity quantity);
  /// Those who came while nothing changes are told what there is.
  void welcomeWatchers();
  void updateStatus(bool announce);

  [[nodiscard]] Result<LoadOutcome> install(Result<scene::Document> document);
  /// Puts a lit scene in place of the present one, which goes on if `made` is an error or cannot be uploaded.
  /// Of an edit, the present one's light is shown until the new one's is as good.
  enum class Relation { kOther, kEdited };
  [[nodiscard]] Result<LitScene::Affected> relight(Result<std::unique_ptr<LitScene>> made, Relation relation);
  [[nodiscard]] Result<void> checkBase(const std::optional<std::uint64_t>& base_revision) const;
  [[nodiscard]] Result<PatchOutcome> applyRequest(const PatchRequest& request);
  [[nodiscard]] Result<PatchOutcome> applyStep(const StepRequest& request);
  /// Makes the edited scene the present one; raises no revision and tells nobody yet.
  [[nodiscard]] Result<PatchOutcome> adopt(scene::EditedDocument edited);
  [[nodiscard]] Result<PatchOutcome> rebuild(scene::EditedDocument edited);
  /// Tells everyone of the new revision and solves on.
  void announceEdit(const PatchOutcome& outcome, const std::string& patch, const std::string& by);
  [[nodiscard]] Result<SolveSettings> applySettings(const SolveSettings& settings);
  /// A solve that has stopped goes on when the settings now ask for more, and is done when they ask for less.
  void reconsiderStop();

  [[nodiscard]] Result<SharedBytes> renderSnapshot(const SnapshotRequest& request);
  [[nodiscard]] Result<SharedBytes> makeUnlit();
  [[nodiscard]] Result<SharedBytes> makeExr(std::uint32_t page, Quantity quantity);

  EngineOptions options_;
  CommandQueue queue_;
  Listeners listeners_;
  Watches watches_;

  // solve thread only
  SolveSettings settings_;
  std::unique_ptr<solver::Transport> transport_;  // made and ended under mutex_: the destructor interrupts it
  std::unique_ptr<gpu::ViewRenderer> view_;
  std::unique_ptr<LitScene> lit_;
  Publisher publisher_;
  History history_;
  SolveState state_ = SolveState::kEmpty;
  std::string failure_;
  std::uint64_t revision_ = 0;
  double seconds_ = 0.0;
  bool unpublished_ = false;
  std::uint64_t unwatched_ = 0;  // publications that nobody was there for
  Clock::time_point next_publish_{}, last_progress_{};

  mutable std::mutex mutex_;  // for the two that any thread may read, and transport_ coming and going
  Status status_;
  std::array<std::shared_ptr<const Lightmaps>, kQuantityCount> lightmaps_;
  std::thread thread_;
};

template <typename T, typename Work>
void SolveLoop::ask(Callback<T> done, Work work) {
  const auto answer = std::make_shared<Callback<T>>(std::move(done));
  if (queue_.push([answer, work = std::move(work)]() mutable { (*answer)(work()); })) return;
  (*answer)(fail(ErrorCode::kBusy, "too many requests are waiting for the solver, try again"));
}

template <typename T, typename Work>
void SolveLoop::askLit(Callback<T> done, Work work) {
  ask<T>(std::move(done), [this, work = std::move(work)]() mutable -> Result<T> {
    if (!lit_) return fail(ErrorCode::kNotFound, "no scene is loaded");
    return work();
  });
}

}  // namespace radiosity::engine
