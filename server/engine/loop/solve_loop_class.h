// The class behind makeEngine (solve_loop.h), private to this folder. Its methods lie in nine files: solve_loop.cpp
// runs the thread, solve_loop_load.cpp takes in scenes, solve_loop_edits.cpp changes scene and settings,
// solve_loop_answers.cpp makes what can be fetched, solve_loop_publish.cpp shows lightmaps to those who watch,
// solve_loop_refine.cpp chooses texels, solve_loop_state.cpp keeps what outlives the process, solve_loop_restore.cpp
// brings it back, solve_loop_recovery.cpp goes on when renderers are lost.
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
#include <vector>

#include "common/log.h"
#include "common/task.h"
#include "server/engine/engine.h"
#include "server/engine/lit/disposer.h"
#include "server/engine/lit/lit_scene.h"
#include "server/engine/lit/memory.h"
#include "server/engine/loop/command_queue.h"
#include "server/engine/loop/listeners.h"
#include "server/engine/loop/load_job.h"
#include "server/engine/loop/long_work.h"
#include "server/engine/loop/refine_job.h"
#include "server/engine/loop/solve_loop.h"
#include "server/engine/loop/upkeep.h"
#include "server/engine/loop/watches.h"
#include "server/engine/persist/history.h"
#include "server/engine/publish/error_history.h"
#include "server/engine/publish/probe_report.h"
#include "server/engine/publish/publisher.h"
#include "server/engine/publish/texel_reader.h"
#include "server/gpu/picture/view_renderer.h"
#include "server/scene/document/document.h"
#include "server/solver/transport/transport.h"
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

  void loadBytes(std::string name, SharedBytes bytes, Client client, Callback<LoadOutcome> done) override;
  void loadFile(std::string path, Client client, Callback<LoadOutcome> done) override;
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
  void sceneGlb(std::optional<std::uint64_t> layout, Client client, Callback<SharedBytes> done) override;
  void unlitGlb(Client client, Callback<SharedBytes> done) override;
  void skyPicture(Client client, Callback<SharedBytes> done) override;
  void lightWeb(std::size_t light, Client client, Callback<ShownWeb> done) override;
  void lightmapExr(std::uint32_t page, Quantity quantity, Client client, Callback<SharedBytes> done) override;
  void snapshot(SnapshotRequest request, Client client, Callback<Snapshot> done) override;
  void texel(TexelRequest request, Callback<Texel> done) override;
  void measure(MeasureRequest request, Client client, Callback<MeasureReport> done) override;
  void probes(ProbeRequest request, Client client, Callback<ProbeReport> done) override;
  void addListener(std::weak_ptr<Listener> listener) override;
  [[nodiscard]] const Past& past() const override { return past_; }
  void callOff() override;
  void keepSolve(std::chrono::milliseconds patience) override;

 private:
  using Clock = std::chrono::steady_clock;

  /// Runs `work` on the solve thread and hands its Result to `done`; answers kBusy at once when the queue is full.
  template <typename T, typename Work>
  void ask(Callback<T> done, Work work);
  /// What a request waits for while a scene is being loaded. kScene: a scene, if only its first light; kWhole: a scene
  /// that can be edited; either waits for the load of its own session as well. kNoLoad: the end of any load.
  enum class Needs { kScene, kWhole, kNoLoad };
  /// As ask(), when what it needs is there.
  template <typename T, typename Work>
  void askOf(Needs needs, std::uint64_t session, Callback<T> done, Work work);
  /// Runs `make` on the thread of long work when there is a scene and it is the client's turn.
  template <typename T, typename Make>
  void askLong(const Client& client, Callback<T> done, Make make);
  /// Thread of long work: what `look` returns, a Result, on the solve thread, which does all that is prompt before.
  /// kNotFound where no scene is there. Waits, with interruption points.
  template <typename Look>
  [[nodiscard]] auto fromSolveThread(Look look) -> decltype(look());

  /// A load counts as under way from here until it is answered: its turn may take a while to come. Any thread.
  [[nodiscard]] Callback<LoadOutcome> countLoad(Callback<LoadOutcome> done);
  /// Begins, on the solve thread, what `request` makes there. Any thread.
  void load(Client client, Callback<LoadOutcome> done, std::function<void(LoadJob::Request&)> complete);

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
  /// While a step is under way: the solve thread has something to do that does not wait for its end.
  [[nodiscard]] bool isWantedElsewhere() const;
  void catchUp();
  /// Solved; what people see of its error is still to be measured.
  [[nodiscard]] bool probesSurface() const;
  void probeSurface();
  /// Where the program chooses texels: what a solve on those that there are has come to is measured, and others take
  /// their place. `otherwise`: how the solve ends where none do.
  struct Refinement {
    SolveState otherwise;
    std::string why;                 ///< where that is kLimited
    std::unique_ptr<RefineJob> job;  ///< null: it is still being measured
  };
  void beginRefinement(SolveState otherwise, std::string why);
  void refineSlice();
  void judgeTexels();
  [[nodiscard]] bool isWorseThanCoarser(double error) const;
  void takeBetterLayout(double error);             ///< that of coarser texels, where light that is so far off is worse
  [[nodiscard]] std::string lackOfTexels() const;  ///< once they are measured
  void endRefinement(SolveState state, std::string why);
  void orderRefined(WantedTexels wanted, double aim);
  void giveUpTexels(const std::string& why);
  void endWithoutMemory();
  /// The time is up: where the light of coarser texels is better, that is what there is.
  void stopInTime();
  void keepTexels();
  void takeRefined();
  void callOffRefinement();
  void dropRefinement();  ///< and what it came from
  [[nodiscard]] bool isOutOfTime() const;
  /// Layouts after one another: each of the first few halves what is missing, about.
  static constexpr int kMostLayouts = 4;
  /// Of measuring what people see, between two looks at what else there is to do.
  static constexpr double kProbeSeconds = 0.02;
  /// So long after an edit nothing is measured: the next may be about to come.
  static constexpr std::chrono::milliseconds kQuiet{300};
  [[nodiscard]] bool isQuiet() const { return Clock::now() - edit_began_ >= kQuiet; }
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

  void beginLoad(LoadJob::Request request);
  void callOffLoad(const std::string& why);  ///< and answers it, where one is under way
  void tellStatus();
  void loadTurn();  ///< takes what the load has made, and tells how far it is
  void endKnown(scene::Document document);
  void settle(Result<std::unique_ptr<LitScene>> whole);
  enum class Upload { kNow, kBegun, kNever };
  void endLoad(Result<std::unique_ptr<LitScene>> whole, Upload upload);
  [[nodiscard]] bool awaitsLoad(Needs needs, std::uint64_t session) const;
  /// Runs the command, or has it wait for the load; `refuse` where too many wait.
  void whenLoaded(Needs needs, std::uint64_t session, CommandQueue::Command command,
                  const std::function<void()>& refuse);
  void runDeferred();  ///< what has waited for a load
  void runCommand(const CommandQueue::Command& command);
  /// A load of many texels: what is shown while they are being made.
  struct FirstLight {
    bool goes_on = true;  ///< its solve
  };
  [[nodiscard]] Result<void> showFirstLight(std::unique_ptr<LitScene> few);
  void firstLightSlice();
  [[nodiscard]] Result<LoadOutcome> settleIn(Result<std::unique_ptr<LitScene>> made, const std::string& by,
                                             Upload upload);
  void unload(SolveState state);
  /// Called when nothing but the disk can fail any more: what is about to come is brought there.
  using Keep = std::function<Result<void>(const PatchOutcome&)>;
  /// Puts a lit scene in place of the present one, which goes on if `made` is an error or cannot be uploaded.
  /// Of an edit, the present one's light is shown until the new one's is as good, and its links go over to it, once
  /// `keep` has succeeded; but for one that is to be solved anew, with another seed say, or on finer
  /// texels, beside which the present one stays (coarser_). A resumed one has its solve
  /// already. Returns what an edit touched.
  enum class Relation { kOther, kEdited, kSolvedAnew, kRefined, kResumed };
  using KeepMade = std::function<Result<void>(const LitScene& made, const LitScene::Affected& at_most)>;
  /// `upload`: kBegun: renderers take it in already; kNever: they take in another, which is to follow it.
  [[nodiscard]] Result<LitScene::Affected> relight(Result<std::unique_ptr<LitScene>> made, Relation relation,
                                                   const KeepMade& keep = {}, Upload upload = Upload::kNow);
  [[nodiscard]] Upload uploadOfEdit() const { return settling_ ? Upload::kNever : Upload::kNow; }
  /// What of it can be undone; what an edit touches, at most. `solve_anew`: the solver, too, which takes nothing over.
  /// `keeps_layout`: whether pages are where those of `former` are.
  [[nodiscard]] Result<LitScene::Affected> tryOut(LitScene& made, LitScene* former, bool solve_anew,
                                                  const KeepMade& keep, Upload upload, bool& keeps_layout);
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
  /// The scene that outlived the last process is there as it was loaded.
  [[nodiscard]] bool isAsLoaded() const;
  /// Whether a document has the bytes that this scene was loaded from. What is returned may be called on any thread.
  [[nodiscard]] std::function<bool(const scene::Document&)> comparison() const;
  [[nodiscard]] Result<void> keepLoad(const History::Next& next, const scene::Document& document);
  /// How an edit is brought to the disk: `after` is the document that it leads to.
  void correctAnswer(PatchOutcome& outcome);
  [[nodiscard]] Keep keepEdit(const History::Next& next, const Receipt& receipt, const scene::Document& after);
  [[nodiscard]] Result<void> keepSettings(const SolveSettings& settings);
  void checkpointIfDue();
  /// True: taken, or not to be had at all.
  [[nodiscard]] bool takeCheckpoint();

  /// What planes and probes are measured in; there is a scene.
  [[nodiscard]] const LitScene& measuredScene() const;
  /// Nothing: pages must be made for it, and may not be.
  [[nodiscard]] std::optional<Result<Texel>> readTexel(const TexelRequest& request, bool may_make);
  void answerTexels();  ///< all that wait for pages
  // Thread of long work.
  [[nodiscard]] Result<SharedBytes> makeGlb(std::optional<std::uint64_t> layout);
  [[nodiscard]] Result<SharedBytes> makeUnlit();
  [[nodiscard]] Result<SharedBytes> makeExr(std::uint32_t page, Quantity quantity);

  EngineOptions options_;
  scene::ImportLimits limits_;
  CommandQueue queue_;
  Listeners listeners_;
  Watches watches_;

  // thread of long work only, but for what probes_ says
  std::unique_ptr<gpu::ViewRenderer> view_;
  ProbeKeeper probes_;
  std::weak_ptr<const Bytes> glb_;                    ///< the last that was made, while it is being sent
  std::pair<std::uint64_t, std::uint64_t> glb_of_{};  ///< its layout and revision

  // solve thread only
  SolveSettings settings_;
  std::unique_ptr<solver::Transport> transport_;  // made and ended under mutex_: the destructor interrupts it
  std::unique_ptr<LitScene> lit_;
  std::unique_ptr<LitScene> former_;       // before the last edit of geometry, solved, for the way back; null: not kept
  std::optional<FirstLight> first_light_;  // then lit_ is made of a few texels, in no history and on no disk
  std::unique_ptr<LoadJob> load_;          // under way; null: none
  /// What it has made, and what renderers take in: meanwhile the scene before is edited, and not solved.
  struct Settling {
    std::unique_ptr<LitScene> made;
    Clock::time_point deadline;  ///< from then on they are waited for
  };
  std::optional<Settling> settling_;
  std::unique_ptr<LoadJob> former_load_;         // called off; it may not have ended yet, which the next one waits for
  double load_told_ = -1.0;                      // how far it was when listeners were told
  std::vector<CommandQueue::Command> deferred_;  // they wait for its end
  Publisher publisher_;
  TexelReader texels_;
  struct AwaitedTexel {
    TexelRequest request;
    std::shared_ptr<Callback<Texel>> answer;
  };
  std::vector<AwaitedTexel> awaited_texels_;  ///< of which pages are to be made
  History history_;
  Disposer disposer_;
  std::shared_ptr<const scene::Document> retired_;  ///< by the last edit of light: it goes when that is done
  SolveState state_ = SolveState::kEmpty;
  std::string failure_;
  std::uint64_t revision_ = 0;
  double seconds_ = 0.0;
  Clock::time_point step_began_{};
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
  std::optional<Refinement> refinement_;  // of the solve under way
  std::unique_ptr<LitScene> coarser_;  // measured, and better than lit_ as far as that is known; null: that is better
  int refined_times_ = 0;              // since the scene was loaded or edited
  std::size_t lost_told_ = 0;          // warnings of lost light that were logged since the load: edits log no others

  std::atomic<Clock::rep> last_beat_{0};  // since the clock's epoch; any thread may read both
  std::atomic<bool> waiting_{true};
  std::atomic<int> loads_{0};
  std::atomic<bool> called_off_{false};
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

  mutable std::mutex mutex_;         // for the four that any thread may read, and transport_ coming and going
  std::shared_ptr<Task> load_task_;  // until the status tells of no load any more
  Status status_;
  ErrorHistory error_history_;
  std::array<std::shared_ptr<const Lightmaps>, kQuantityCount> lightmaps_;
  std::unique_ptr<LongWork> long_work_;
  std::thread thread_;
};

template <typename T, typename Work>
void SolveLoop::ask(Callback<T> done, Work work) {
  const auto answer = std::make_shared<Callback<T>>(std::move(done));
  if (queue_.push([answer, work = std::move(work)]() mutable { (*answer)(withinMemory(work)); })) return;
  (*answer)(tooMany());
}

template <typename T, typename Work>
void SolveLoop::askOf(Needs needs, std::uint64_t session, Callback<T> done, Work work) {
  const auto answer = std::make_shared<Callback<T>>(std::move(done));
  const auto refuse = [answer] { (*answer)(tooMany()); };
  const auto command = [answer, work = std::move(work)]() mutable { (*answer)(withinMemory(work)); };
  if (!queue_.push([this, needs, session, command, refuse] { whenLoaded(needs, session, command, refuse); })) refuse();
}

template <typename T, typename Make>
void SolveLoop::askLong(const Client& client, Callback<T> done, Make make) {
  const auto answer = std::make_shared<Callback<T>>(std::move(done));
  const auto refuse = [answer](const Error& error) { (*answer)(tl::unexpected<Error>(error)); };
  const auto run = [answer, make = std::move(make)] {
    auto made = make();
    try {
      (*answer)(std::move(made));
    } catch (const std::bad_alloc&) {  // what was asked is done
      log::error("out of memory: an answer was dropped");
    }
  };
  const auto order = [this, client, run, refuse] {
    if (!long_work_->push(client, run, refuse)) refuse(tooMany().value());
  };
  const auto tell_busy = [refuse] { refuse(tooMany().value()); };
  const auto session = client.session;
  if (!queue_.push([this, session, order, tell_busy] { whenLoaded(Needs::kScene, session, order, tell_busy); }))
    tell_busy();
}

template <typename Look>
auto SolveLoop::fromSolveThread(Look look) -> decltype(look()) {
  using Found = decltype(look());
  constexpr auto kNap = std::chrono::milliseconds(20);
  const auto promise = std::make_shared<std::promise<Found>>();
  auto found = promise->get_future();
  // Weak: nothing is looked for once nobody waits.
  const auto command = [this, waiting = std::weak_ptr(promise), look = std::move(look)]() mutable {
    const auto heard = waiting.lock();
    if (!heard) return;
    heard->set_value(lit_ ? withinMemory(look) : Found(noScene()));
  };
  if (!queue_.push(command, CommandQueue::Kind::kLong)) return tooMany();
  while (found.wait_for(kNap) != std::future_status::ready) interruptionPoint();
  return found.get();
}

}  // namespace radiosity::engine
