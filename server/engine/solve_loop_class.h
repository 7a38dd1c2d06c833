// The class behind makeEngine (solve_loop.h), private to this folder. Its methods lie in eight files: solve_loop.cpp
// runs the thread, solve_loop_load.cpp takes in scenes, solve_loop_edits.cpp changes scene and settings,
// solve_loop_answers.cpp makes what can be fetched, solve_loop_publish.cpp shows lightmaps to those who watch,
// solve_loop_state.cpp keeps what outlives the process, solve_loop_restore.cpp brings it back, solve_loop_recovery.cpp
// goes on when renderers are lost.
#pragma once

#include <array>
#include <atomic>
#include <chrono>
#include <cstdint>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <utility>

#include "server/engine/command_queue.h"
#include "server/engine/engine.h"
#include "server/engine/error_history.h"
#include "server/engine/history.h"
#include "server/engine/listeners.h"
#include "server/engine/lit_scene.h"
#include "server/engine/memory.h"
#include "server/engine/publisher.h"
#include "server/engine/solve_loop.h"
#include "server/engine/texel_reader.h"
#include "server/engine/upkeep.h"
#include "server/engine/watches.h"
#include "server/gpu/view_renderer.h"
#include "server/scene/document.h"
#include "server/solver/transport.h"
#include "server/state/checkpoint.h"

namespace radiosity::engine {

[[nodiscard]] inline tl::unexpected<Error> tooMany() {
  return fail(ErrorCode::kBusy, "too many requests are waiting for the solver, try again");
}
[[nodiscard]] inline tl::unexpected<Error> noScene() { return fail(ErrorCode::kNotFound, "no scene is loaded"); }

class SolveLoop final : public Engine {
 public:
  explicit SolveLoop(EngineOptions options);
  ~SolveLoop() override;
  SolveLoop(const SolveLoop&) = delete;
  SolveLoop& operator=(const SolveLoop&) = delete;

  /// Starts the thread and the transport; returns when both are up.
  [[nodiscard]] Result<void> start();

  void loadBytes(std::string name, SharedBytes bytes, std::string by, Callback<LoadOutcome> done) override;
  void loadFile(std::string path, std::string by, Callback<LoadOutcome> done) override;
  void openFile(std::string path, bool anew, Callback<LoadOutcome> done) override;
  void patch(PatchRequest request, Callback<PatchOutcome> done) override;
  void step(StepRequest request, Callback<PatchOutcome> done) override;
  void history(Callback<HistoryReport> done) override;
  void configure(ChangeSettings change, Callback<SolveSettings> done) override;
  void pause(Callback<SolveState> done) override;
  void resume(Callback<SolveState> done) override;
  void restart(Callback<SolveState> done) override;
  [[nodiscard]] Status status() const override;
  [[nodiscard]] SolveHistory solveHistory() const override;
  [[nodiscard]] double busySeconds() const override;
  [[nodiscard]] std::shared_ptr<void> watch(Quantity quantity) override;
  [[nodiscard]] std::shared_ptr<const Lightmaps> lightmaps(Quantity quantity) const override;
  void sceneText(Callback<SceneText> done) override;
  void sceneGlb(std::optional<std::uint64_t> layout, Callback<SharedBytes> done) override;
  void unlitGlb(Callback<SharedBytes> done) override;
  void lightmapExr(std::uint32_t page, Quantity quantity, Callback<SharedBytes> done) override;
  void snapshot(SnapshotRequest request, Callback<Snapshot> done) override;
  void texel(TexelRequest request, Callback<Texel> done) override;
  void addListener(std::weak_ptr<Listener> listener) override;
  [[nodiscard]] const Past& past() const override { return past_; }
  void keepSolve(std::chrono::milliseconds patience) override;

 private:
  using Clock = std::chrono::steady_clock;

  /// Runs `work` on the solve thread and hands its Result to `done`; answers kBusy at once when the queue is full.
  template <typename T, typename Work>
  void ask(Callback<T> done, Work work, CommandQueue::Kind kind = CommandQueue::Kind::kPrompt);
  /// The same; answers kNotFound while no scene is loaded.
  template <typename T, typename Work>
  void askLit(Callback<T> done, Work work, CommandQueue::Kind kind = CommandQueue::Kind::kLong);
  /// For what changes the scene or the solve: of a scene that is still being loaded the whole must be there.
  template <typename T, typename Work>
  void askToChange(Callback<T> done, Work work);

  /// A load counts as under way from here until it is answered: reading a large file takes its time. Any thread.
  [[nodiscard]] Callback<LoadOutcome> countLoad(Callback<LoadOutcome> done);
  /// Nothing: the scene's first light is being shown, and the answer comes when all of it is there.
  using LoadBegun = Result<std::optional<LoadOutcome>>;
  /// Runs `begin` on the solve thread. Any thread.
  void load(Callback<LoadOutcome> done, std::function<LoadBegun()> begin);

  // All below: solve thread only.
  void threadMain(std::promise<Result<void>> started);
  [[nodiscard]] bool runCommands();
  void takeTurn();  ///< what is done between commands
  [[nodiscard]] bool hasNothingToDo() const;
  void lookAfter();           ///< what may break while nobody asks for anything
  void lookAfterRenderers();  ///< of a solve that needs none at present
  void solveSlice();
  [[nodiscard]] Result<solver::StepOutcome> stepSolver();
  /// Solved and told; what was left for later since it matters little is done between commands.
  [[nodiscard]] bool isBehind() const;
  void catchUp();
  void tellProgress(bool assess);  ///< not oftener than anyone can see; `assess`: with a new error
  /// The clock starts over: another scene, another seed, an edit. A paused solve stays paused.
  void beginSolve();
  void endSolve(SolveState state);
  /// The transport failed. True: it will be tried again after a while, from the solve's beginning.
  [[nodiscard]] bool willRecover(const Error& error);
  /// Whether there is a transport that works; tries to get one when it is time to.
  [[nodiscard]] bool rendererIsBack();
  void tellLostLight();  ///< of the scene, once it is solved
  void tellLosses();     ///< of renderers that were replaced
  void beat();           ///< the thread is alive and has finished something

  /// What is watched and not published yet; `final`: as a new version in any case. True: and the status is that of now
  /// but for what this itself changed.
  bool publishLightmaps(bool final);
  [[nodiscard]] bool showsNothingNew() const;
  [[nodiscard]] bool watchesIrradianceAlone() const;
  void showEdit();
  [[nodiscard]] QuantityPages pagesToShow(Quantity quantity);
  void publishQuantity(Quantity quantity);
  [[nodiscard]] Clock::duration publishPause(Clock::duration took) const;
  /// Those who came while nothing changes are told what there is.
  void welcomeWatchers();
  [[nodiscard]] bool lacksPages() const;
  /// `as_reported`: of the solve nothing has changed since the last time.
  void updateStatus(bool announce, bool as_reported = false);

  [[nodiscard]] LoadBegun install(Result<scene::Document> document, const std::string& by);
  /// A load of many texels: what is shown while they are being made, and who waits for them.
  struct FirstLight {
    std::future<Result<std::unique_ptr<LitScene>>> whole;
    Callback<LoadOutcome> done;
    std::string by;                           ///< who has loaded it
    std::shared_ptr<std::atomic<bool>> made;  ///< `whole` is there, but for the moment that its thread takes to end
    bool goes_on = true;                      ///< its solve
  };
  [[nodiscard]] bool wantsFirstLight(const scene::Scene& scene) const;
  [[nodiscard]] Result<void> showFirstLight(const scene::EditedDocument& edited, const std::string& by);
  [[nodiscard]] Result<void> makeWhole(const scene::EditedDocument& edited);
  void firstLightSlice();
  /// Puts the whole scene in place of its first light; waits for it. Nothing to do where no first light is shown.
  void endFirstLight();
  [[nodiscard]] Result<LoadOutcome> settleIn(Result<std::unique_ptr<LitScene>> made, const std::string& by);
  void unload(SolveState state);
  /// Called when nothing but the disk can fail any more: what is about to come is brought there.
  using Keep = std::function<Result<void>(const PatchOutcome&)>;
  /// Puts a lit scene in place of the present one, which goes on if `made` is an error or cannot be uploaded.
  /// Of an edit, the present one's light is shown until the new one's is as good, and its links go over to it, once
  /// `keep` has succeeded; but for one that is to be solved anew, with another seed say. A resumed one has its solve
  /// already. Returns what an edit touched.
  enum class Relation { kOther, kEdited, kSolvedAnew, kResumed };
  using KeepMade = std::function<Result<void>(const LitScene& made, const LitScene::Affected& at_most)>;
  [[nodiscard]] Result<LitScene::Affected> relight(Result<std::unique_ptr<LitScene>> made, Relation relation,
                                                   const KeepMade& keep = {});
  /// What of it can be undone; what an edit touches, at most. `solve_anew`: the solver, too, which takes nothing over.
  /// `keeps_layout`: whether pages are where those of `former` are.
  [[nodiscard]] Result<LitScene::Affected> tryOut(LitScene& made, LitScene* former, bool solve_anew,
                                                  const KeepMade& keep, bool& keeps_layout);
  /// The edited scene, which is on the disk, takes the place of the present one and its links, where there is memory
  /// for both; else it is solved anew; where there is no memory for that either, no scene is there and the solve has
  /// failed. Returns the shots that are to be taken again.
  [[nodiscard]] std::uint64_t takeLinks(std::unique_ptr<LitScene> made);
  /// The same for an edit that leads back to the geometry of `former_`: that one and its solve are the present ones
  /// again, with what `change` says of light and colour, and nothing is measured.
  [[nodiscard]] Result<PatchOutcome> goBack(scene::EditedDocument edited, const SceneChange& change, const Keep& keep);
  /// Solved, small beside the machine, and with room for as much again in the memory for links.
  [[nodiscard]] bool isWorthKeeping(const LitScene& lit) const;
  [[nodiscard]] bool holdsBoth() const;  ///< the memory for links those of `lit_` and of `former_`
  void putBack();                        ///< the present scene, after another was tried
  [[nodiscard]] Result<void> checkBase(const std::optional<std::uint64_t>& base_revision) const;
  [[nodiscard]] Result<void> checkScene(const std::optional<std::uint64_t>& same_scene_as) const;
  [[nodiscard]] Result<PatchOutcome> applyRequest(const PatchRequest& request);
  [[nodiscard]] Result<PatchOutcome> applyStep(const StepRequest& request);
  /// Makes the edited scene the present one; raises no revision and tells nobody yet.
  [[nodiscard]] Result<PatchOutcome> adopt(scene::EditedDocument edited, const Keep& keep);
  [[nodiscard]] bool takeInLight(const std::function<bool()>& tell);
  [[nodiscard]] Result<PatchOutcome> rebuild(scene::EditedDocument edited, const Keep& keep);
  /// Tells everyone of the new revision and solves on.
  void announceEdit(const PatchOutcome& outcome, const std::string& patch, const std::string& by);
  [[nodiscard]] Result<SolveSettings> applySettings(const SolveSettings& settings);
  void takeSettings(const SolveSettings& before, bool reshaped, bool anew);
  /// A solve that has stopped goes on when the settings now ask for more, and is done when they ask for less.
  void reconsiderStop();

  // What outlives the process; all of it nothing without a store.
  [[nodiscard]] Result<void> restoreState();
  [[nodiscard]] Result<void> restoreScene(state::Kept kept);
  [[nodiscard]] Result<void> restoreSolve(const scene::Document& document);
  [[nodiscard]] Result<void> lightKept(const scene::Document& document);
  [[nodiscard]] Result<std::unique_ptr<LitScene>> resumedScene(const scene::Document& document,
                                                               const Bytes& checkpoint);
  /// The scene that outlived the last process was loaded from the same bytes, and nothing else has been loaded since.
  [[nodiscard]] bool goesOnWith(const scene::Document& document, bool with_edits) const;
  [[nodiscard]] Result<void> keepLoad(const History::Next& next, const scene::Document& document);
  /// How an edit is brought to the disk: `after` is the document that it leads to.
  void correctAnswer(PatchOutcome& outcome);
  [[nodiscard]] Keep keepEdit(const History::Next& next, const Receipt& receipt, const scene::Document& after);
  [[nodiscard]] Result<void> keepSettings(const SolveSettings& settings);
  void checkpointIfDue();
  /// True: taken, or not to be had at all.
  [[nodiscard]] bool takeCheckpoint();

  [[nodiscard]] Result<Snapshot> renderSnapshot(const SnapshotRequest& request);
  /// Nothing: pages must be made for it, and may not be.
  [[nodiscard]] std::optional<Result<Texel>> readTexel(const TexelRequest& request, bool may_make);
  void answerTexels();  ///< all that wait for pages
  [[nodiscard]] Result<SharedBytes> makeGlb();
  [[nodiscard]] Result<SharedBytes> makeUnlit();
  [[nodiscard]] Result<SharedBytes> makeExr(std::uint32_t page, Quantity quantity);

  EngineOptions options_;
  scene::ImportLimits limits_;
  CommandQueue queue_;
  Listeners listeners_;
  Watches watches_;

  // solve thread only
  SolveSettings settings_;
  std::unique_ptr<solver::Transport> transport_;  // made and ended under mutex_: the destructor interrupts it
  std::unique_ptr<gpu::ViewRenderer> view_;
  std::weak_ptr<const Bytes> glb_;                    ///< the last that was made, while it is being sent
  std::pair<std::uint64_t, std::uint64_t> glb_of_{};  ///< its layout and revision
  std::unique_ptr<LitScene> lit_;
  std::unique_ptr<LitScene> former_;       // before the last edit of geometry, solved, for the way back; null: not kept
  std::optional<FirstLight> first_light_;  // then lit_ is made of a few texels, in no history and on no disk
  Publisher publisher_;
  TexelReader texels_;
  struct AwaitedTexel {
    TexelRequest request;
    std::shared_ptr<Callback<Texel>> answer;
  };
  std::vector<AwaitedTexel> awaited_texels_;  ///< of which pages are to be made
  History history_;
  std::optional<scene::Document> retired_;  ///< by the last edit of light: it goes when that is done
  SolveState state_ = SolveState::kEmpty;
  std::string failure_;
  std::uint64_t revision_ = 0;
  double seconds_ = 0.0;
  bool unpublished_ = false;
  bool shown_is_own_ = true;     // what was published last is of this solver, not of one that it took turns with
  bool stepped_ = false;         // the solver, since the present version began
  std::uint64_t steps_ = 0;      // of all solvers
  std::uint64_t unwatched_ = 0;  // publications that nobody was there for
  Clock::time_point next_publish_{}, next_progress_{};
  Clock::time_point edit_began_{};               // the last one
  std::optional<Clock::time_point> owes_pages_;  // by then, of the light before an edit where things lie now
  bool renderer_lost_ = false;
  unsigned recoveries_ = 0;  // of this solve
  Clock::time_point retry_at_{};
  std::uint64_t losses_told_ = 0, solve_restarts_ = 0;
  Upkeep upkeep_;
  std::size_t lost_told_ = 0;  // warnings of lost light that were logged since the load: edits log no others

  std::atomic<Clock::rep> last_beat_{0};  // since the clock's epoch; any thread may read both
  std::atomic<bool> waiting_{true};
  std::atomic<int> loads_{0};
  std::unique_ptr<state::CheckpointWriter> checkpoints_;  // null: none are kept
  Clock::time_point next_checkpoint_{};
  std::uint64_t checkpoint_revision_ = 0, checkpoint_shots_ = 0;  // of the last that was taken
  bool checkpoint_too_large_ = false;                             // the last one was
  std::string loaded_digest_;                                     // of the scene that outlived the last process
  std::optional<state::Answer> kept_answer_;                      // of the edit under way
  bool as_restored_ = false;                                      // the scene is that one; no edit, no load since
  std::uint64_t resumed_shots_ = 0;
  std::uint64_t went_back_ = 0;  // edits that led back to a solve that was kept
  Past past_;                    // constant once start() has returned

  mutable std::mutex mutex_;  // for the three that any thread may read, and transport_ coming and going
  Status status_;
  ErrorHistory error_history_;
  std::array<std::shared_ptr<const Lightmaps>, kQuantityCount> lightmaps_;
  std::thread thread_;
};

template <typename T, typename Work>
void SolveLoop::ask(Callback<T> done, Work work, CommandQueue::Kind kind) {
  const auto answer = std::make_shared<Callback<T>>(std::move(done));
  if (queue_.push([answer, work = std::move(work)]() mutable { (*answer)(withinMemory(work)); }, kind)) return;
  (*answer)(tooMany());
}

template <typename T, typename Work>
void SolveLoop::askToChange(Callback<T> done, Work work) {
  ask<T>(std::move(done), [this, work = std::move(work)]() mutable -> Result<T> {
    endFirstLight();
    return work();
  });
}

template <typename T, typename Work>
void SolveLoop::askLit(Callback<T> done, Work work, CommandQueue::Kind kind) {
  ask<T>(
      std::move(done),
      [this, work = std::move(work)]() mutable -> Result<T> {
        if (!lit_) return noScene();
        return work();
      },
      kind);
}

}  // namespace radiosity::engine
