#include "server/engine/loop/solve_loop.h"

#include <fmt/format.h>

#include <algorithm>

#include "common/log.h"
#include "server/engine/lit/thread_time.h"
#include "server/engine/loop/solve_loop_class.h"
#include "server/engine/publish/status_report.h"

namespace radiosity::engine {
namespace {

constexpr std::size_t kMaxQueue = 1024;
/// Between two looks whether renderers have taken in what a load has made.
constexpr std::chrono::nanoseconds kSettlingNap = std::chrono::milliseconds(5);
constexpr auto kProgressInterval = std::chrono::milliseconds(100);
/// Estimating the error and weighing all light go over every texel: they take no more than one part in so many of the
/// solve thread's time.
constexpr int kProgressShare = 10;
/// A solve that took longer is worth a checkpoint at its end.
constexpr double kLongSolveSeconds = 2.0;

/// A solve that has come to its time limit takes in what is measured; where that takes longer it stays as it is.
constexpr double kLimitGrace = 3.0;

std::string limitText(solver::SolveLimit limit, std::uint64_t link_memory_bytes) {
  constexpr double kMebi = 1048576.0;
  switch (limit) {
    case solver::SolveLimit::kLinkMemory:
      return fmt::format("the memory for links, {:.1f} MiB, is used up; --link-memory gives it more",
                         static_cast<double>(link_memory_bytes) / kMebi);
    case solver::SolveLimit::kPatches:
      return "every patch shoots for itself and no sample lowers the error any more; more texels would";
    case solver::SolveLimit::kRays:
      return "texels cast as many rays as they may; more texels would lower the error";
    case solver::SolveLimit::kWithin:
      return "light varies within texels of which others see only a part; more texels would lower the error";
    case solver::SolveLimit::kRounds:
    case solver::SolveLimit::kNone:
      break;
  }
  return "as many rounds are done as there is room for";
}

}  // namespace

SolveLoop::SolveLoop(EngineOptions options)
    : options_(std::move(options)), queue_(kMaxQueue), settings_(options_.settings), upkeep_(options_.store) {
  limits_.max_scene_bytes = options_.max_scene_bytes;
}

SolveLoop::~SolveLoop() {
  queue_.close();
  if (long_work_) callOff();
  {
    const std::scoped_lock lock(mutex_);
    if (transport_) transport_->interrupt();
  }
  if (thread_.joinable()) thread_.join();
  long_work_.reset();
}

Result<void> SolveLoop::start() {
  long_work_ = std::make_unique<LongWork>(kMaxQueue, [this] { view_.reset(); });
  // The thread owns the promise: here it would go while set_value() is still at work on it.
  std::promise<Result<void>> started;
  auto outcome = started.get_future();
  thread_ = std::thread([this, started = std::move(started)]() mutable { threadMain(std::move(started)); });
  return outcome.get();
}

void SolveLoop::threadMain(std::promise<Result<void>> started) {
  auto transport = options_.make_transport();
  if (!transport) {
    started.set_value(tl::unexpected<Error>(transport.error()));
    return;
  }
  {
    const std::scoped_lock lock(mutex_);
    transport_ = std::move(*transport);
  }
  limits_.renderers = transport_->look().wanted;
  transport_->setImpatience([this] { return isWantedElsewhere(); });
  if (auto restored = restoreState(); !restored) {
    {
      const std::scoped_lock lock(mutex_);
      transport_.reset();
    }
    started.set_value(tl::unexpected<Error>(restored.error()));
    return;
  }
  (void)upkeep_.wantsRenderers(*transport_);
  updateStatus(false);
  started.set_value({});
  while (runCommands()) {
    takeTurn();
  }
  checkpoints_.reset();
  dropRefinement();
  (void)disposer_.drain();  // while the transport is there
  load_.reset();
  former_load_.reset();
  settling_.reset();
  first_light_.reset();
  texels_.forget();
  former_.reset();
  lit_.reset();
  const std::scoped_lock lock(mutex_);
  transport_.reset();
}

/// Sleeps while there is nothing to solve, then does all commands that are due. False: the engine is being destroyed.
bool SolveLoop::runCommands() {
  std::optional<std::vector<CommandQueue::Command>> due;
  do {
    const bool rests = probesSurface() && !isQuiet();
    waiting_ = settling_ || rests || hasNothingToDo();
    due = queue_.take(waiting_, settling_ || rests ? kSettlingNap : Upkeep::kInterval);
    beat();
    waiting_ = false;
    if (!due) return false;
    lookAfter();
  } while (due->empty() && !queue_.wasWoken() && !settling_ && hasNothingToDo());
  for (const auto& command : *due) {
    if (queue_.closed()) return false;
    runCommand(command);
  }
  return true;
}

bool SolveLoop::hasNothingToDo() const {
  if (first_light_) return !first_light_->goes_on;
  if (state_ == SolveState::kSolving)
    return refinement_ && refinement_->job && !refinement_->job->isDone() && !isOutOfTime();
  return !isBehind() && !probesSurface();
}

void SolveLoop::runCommand(const CommandQueue::Command& command) {
  try {
    command();
  } catch (const std::bad_alloc&) {  // of the answer: what was asked is done
    log::error("out of memory: an answer was dropped");
  }
  beat();
}

/// Where memory runs out in it the solve has failed: whatever frees some, an edit or a smaller scene, starts another.
void SolveLoop::takeTurn() {
  texels_.keepOnly(publisher_.layout());
  try {
    welcomeWatchers();
    if (load_) loadTurn();
    if (settling_) return checkpointIfDue();
    if (first_light_)
      firstLightSlice();
    else if (state_ == SolveState::kSolving && refinement_)
      refineSlice();
    else if (state_ == SolveState::kSolving)
      solveSlice();
    else if (isBehind())
      catchUp();
    else if (probesSurface() && isQuiet())
      probeSurface();
    checkpointIfDue();
  } catch (const std::bad_alloc&) {
    texels_.forget();
    retired_.reset();
    if (disposer_.drain()) return log::warn("out of memory: what was of no use any more is gone now");
    if (probesSurface()) {  // what is solved stays
      lit_->giveUpSurface();
      return updateStatus(true);
    }
    if (std::exchange(coarser_, nullptr)) return log::warn("out of memory: the light of coarser texels is forgotten");
    if (refinement_) return endWithoutMemory();
    if (std::exchange(former_, nullptr)) return log::warn("out of memory: the scene before the last edit is forgotten");
    if (first_light_) {  // the whole may still be had
      first_light_->goes_on = unpublished_ = false;
      log::warn("out of memory: the first light stays as it is");
      return;
    }
    failure_ = outOfMemory().value().message;
    log::error("solve stopped: {}", failure_);
    state_ = SolveState::kFailed;
    unpublished_ = false;
    if (owes_pages_) (void)fitsMemory([&] { publishLightmaps(false); });
    next_checkpoint_ = Clock::now() + options_.checkpoint_interval;
    updateStatus(true);
  }
}

void SolveLoop::solveSlice() {
  if (renderer_lost_ && !rendererIsBack()) return;
  if (lit_->isStale()) lit_->restart(settings_);
  const auto begin = Clock::now();
  const auto outcome = stepSolver();
  seconds_ += std::chrono::duration<double>(Clock::now() - begin).count();
  if (queue_.closed()) return;  // nobody is left to be told
  tellLosses();
  if (former_ && !holdsBoth()) former_.reset();
  if (!outcome) {
    if (outcome.error().code == ErrorCode::kTooLarge && std::exchange(former_, nullptr)) return lit_->invalidate();
    if (willRecover(outcome.error())) return;
    failure_ = outcome.error().text();
    log::error("solve stopped: {}", failure_);
    endSolve(SolveState::kFailed);
    return;
  }
  const bool out_of_time = isOutOfTime();
  if (*outcome == solver::StepOutcome::kSlice) {
    if (out_of_time && seconds_ >= *settings_.time_limit_s + kLimitGrace) {
      unpublished_ = true;
      return stopInTime();
    }
    if (out_of_time) lit_->solver().endWave();
    if (Clock::now() >= next_publish_ && lit_->showDirectLight()) {
      unpublished_ = true;
      publishLightmaps(false);
    } else if (owes_pages_ && Clock::now() >= *owes_pages_) {
      publishLightmaps(false);
    }
    disposer_.dispose(std::exchange(retired_, nullptr));
    return tellProgress(false);
  }
  unpublished_ = true;
  const bool chooses = settings_.choosesTexels();
  if (*outcome == solver::StepOutcome::kConverged) {
    chooses ? beginRefinement(SolveState::kConverged, {}) : endSolve(SolveState::kConverged);
  } else if (*outcome == solver::StepOutcome::kExhausted) {
    auto why = limitText(lit_->solver().limit(), settings_.link_memory_bytes);
    chooses ? beginRefinement(SolveState::kLimited, std::move(why))
            : endRefinement(SolveState::kLimited, std::move(why));
  } else if (out_of_time) {
    stopInTime();
  } else {
    if (owes_pages_ || Clock::now() >= next_publish_) publishLightmaps(false);
    tellProgress(true);
  }
}

Result<solver::StepOutcome> SolveLoop::stepSolver() {
  stepped_ = true;
  ++steps_;
  step_began_ = Clock::now();
  lit_->forgetSurface();
  return lit_->solver().step();
}

bool SolveLoop::isWantedElsewhere() const {
  if (queue_.isPressing() || (load_ && load_->task()->isCancelled())) return true;
  // Without any light there would be nothing to end with.
  if (!settings_.time_limit_s || state_ != SolveState::kSolving || first_light_ || lit_->solver().shots() == 0)
    return false;
  const double seconds = seconds_ + std::chrono::duration<double>(Clock::now() - step_began_).count();
  return seconds >= *settings_.time_limit_s + kLimitGrace;
}

bool SolveLoop::isBehind() const {
  return state_ == SolveState::kConverged && lit_ && !lit_->isStale() && lit_->solver().isBehind();
}

/// Takes no solve time, and says nothing before it is done: what is shown is solved.
void SolveLoop::catchUp() {
  const auto outcome = stepSolver();
  if (queue_.closed()) return;
  tellLosses();
  if (outcome && *outcome == solver::StepOutcome::kSlice) return;
  unpublished_ = true;
  if (outcome && *outcome == solver::StepOutcome::kConverged) {
    if (!settings_.choosesTexels()) return endSolve(SolveState::kConverged);
    state_ = SolveState::kSolving;  // until it is measured again
    return beginRefinement(SolveState::kConverged, {});
  }
  // With all links it is not solved after all, or no renderer is left: the next slice goes on, or finds out.
  if (!outcome) lit_->invalidate();
  state_ = SolveState::kSolving;
  updateStatus(true);
}

bool SolveLoop::probesSurface() const {
  const bool is_solved =
      state_ == SolveState::kConverged || state_ == SolveState::kLimited || state_ == SolveState::kTimeLimit;
  return is_solved && lit_ && !lit_->isStale() && lit_->lacksSurface() && !isBehind();
}

/// Takes no solve time: what is shown stays what it is.
void SolveLoop::probeSurface() {
  lit_->probeSurface(kProbeSeconds, isOutOfTime());
  if (!lit_->lacksSurface()) updateStatus(true);
}

void SolveLoop::tellProgress(bool assess) {
  if (Clock::now() < next_progress_) return;
  const auto begin = threadTime();
  if (assess) lit_->solver().assess();
  updateStatus(true);
  next_progress_ = Clock::now() + std::max<Clock::duration>(kProgressInterval, kProgressShare * (threadTime() - begin));
}

void SolveLoop::beginSolve() {
  seconds_ = 0.0;
  failure_.clear();
  dropRefinement();
  refined_times_ = 0;
  if (state_ != SolveState::kPaused) state_ = SolveState::kSolving;
  unpublished_ = true;
  updateStatus(true);
}

void SolveLoop::endSolve(SolveState state) {
  state_ = state;
  renderer_lost_ = state == SolveState::kFailed && renderer_lost_;
  recoveries_ = 0;
  if (queue_.closed()) return;
  if (lit_) {
    if (state != SolveState::kConverged) lit_->solver().assess();  // that it says of what it knows now
    if (state != SolveState::kFailed) lit_->endFade();
    if (state != SolveState::kFailed) tellLostLight();
  }
  const bool reported = publishLightmaps(true);
  updateStatus(true, reported);
  disposer_.dispose(std::exchange(retired_, nullptr));
  // Of the short solves of a drag the next periodic one will do: thirty a second would stand in the way of the edits.
  if (seconds_ > kLongSolveSeconds) next_checkpoint_ = Clock::now();
}

void SolveLoop::tellLostLight() {
  lit_->reportLight();
  const auto told = std::exchange(lost_told_, std::max(lost_told_, lit_->lostLight().size()));
  if (lost_told_ == told) return;
  const LogScope about({.revision = revision_});
  for (const auto& warning : lit_->lostLight()) log::warn("{}", warning);
}

void SolveLoop::updateStatus(bool announce, bool as_reported) {
  Status status = as_reported ? status_ : lit_ && !first_light_ ? reportStatus(*lit_, seconds_) : Status{};
  status.state = load_ ? SolveState::kLoading : state_;
  status.load_fraction.reset();
  if (load_) status.load_fraction = load_->task()->fraction();
  status.revision = revision_;
  status.tile_version = publisher_.version();
  status.layout_since = publisher_.layoutSince();
  status.seconds = seconds_;
  status.settings = settings_;
  status.failure = failure_;
  status.probes_surface = probesSurface();
  status.renderer_lost = renderer_lost_;
  status.renderers_replaced = losses_told_;
  status.solve_restarts = solve_restarts_;
  upkeep_.addTo(status);
  if (lit_) {
    const auto& tiles = publisher_.tileCounters();
    status.counters["tiles.changed"] = static_cast<double>(tiles.changed);
    status.counters["skip.tilesUnchanged"] = static_cast<double>(tiles.unchanged);
    status.counters["skip.solvesReturned"] = static_cast<double>(went_back_);
    status.counters["skip.publicationsUnwatched"] = static_cast<double>(unwatched_);
    if (checkpoints_) {
      const auto written = checkpoints_->counters();
      status.counters["state.checkpoints"] = static_cast<double>(written.written);
      status.counters["state.checkpointsFailed"] = static_cast<double>(written.failed);
      status.counters["state.checkpointBytes"] = static_cast<double>(written.bytes);
      status.counters["state.checkpointSeconds"] = written.seconds;
      status.counters["state.resumedShots"] = static_cast<double>(resumed_shots_);
    }
  }
  status.gl_renderer = transport_->description();
  {
    const std::scoped_lock lock(mutex_);
    if (!load_) load_task_.reset();
    status_ = status;
    if (announce) error_history_.add(status.seconds, status.error);
  }
  if (!announce) return;
  next_progress_ = Clock::now() + kProgressInterval;
  listeners_.tell([&](Listener& listener) { listener.onProgress(status); });
}

Status SolveLoop::status() const {
  const std::scoped_lock lock(mutex_);
  auto status = status_;
  if (loads_ > 0 && status.state == SolveState::kEmpty) status.state = SolveState::kLoading;
  if (status.state == SolveState::kLoading) status.load_fraction = load_task_ ? load_task_->fraction() : 0.0;
  return status;
}

SolveHistory SolveLoop::solveHistory() const {
  const std::scoped_lock lock(mutex_);
  return {status_.revision, error_history_.samples()};
}

void SolveLoop::addListener(std::weak_ptr<Listener> listener) { listeners_.add(std::move(listener)); }

Result<std::unique_ptr<Engine>> makeEngine(EngineOptions options) {
  auto loop = std::make_unique<SolveLoop>(std::move(options));
  if (const auto started = loop->start(); !started) return tl::unexpected<Error>(started.error());
  return loop;
}

}  // namespace radiosity::engine
