// Loading a scene. A thread of its own reads it and makes what the solver needs (load_job.h), while the scene before is
// solved and edited. Making millions of texels takes many seconds, and their first light takes more: of such a scene
// those who watch are shown its first light on few texels, while all are made. Whatever is promised (answers, stated
// errors, waits, checkpoints, the bits of the result) holds for the whole alone: until it is there the state told is
// kLoading, and whoever asks for a change of it waits for it.
#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include "common/log.h"
#include "server/engine/loop/solve_loop_class.h"
#include "server/engine/persist/checkpoint_head.h"

namespace radiosity::engine {
namespace {

/// That wait for a load.
constexpr std::size_t kMostDeferred = 1024;
/// Renderers that take in a scene for longer hang, or are so slow that nobody is to solve meanwhile.
constexpr auto kSettlingPatience = std::chrono::seconds(20);

}  // namespace

Engine::Callback<LoadOutcome> SolveLoop::countLoad(Callback<LoadOutcome> done) {
  ++loads_;
  return [this, done = std::move(done)](Result<LoadOutcome> outcome) {
    --loads_;
    done(std::move(outcome));
  };
}

void SolveLoop::load(Client client, Callback<LoadOutcome> done, std::function<void(LoadJob::Request&)> complete) {
  const auto answer = std::make_shared<Callback<LoadOutcome>>(countLoad(std::move(done)));
  const auto run = [this, client = std::move(client), answer, complete = std::move(complete)] {
    LoadJob::Request request{{}, client, *answer};
    complete(request);
    beginLoad(std::move(request));
  };
  if (queue_.push(run)) return;
  (*answer)(tooMany());
}

void SolveLoop::loadBytes(std::string name, SharedBytes bytes, Client client, Callback<LoadOutcome> done) {
  load(std::move(client), std::move(done),
       [this, name = std::move(name), bytes = std::move(bytes)](LoadJob::Request& request) {
         request.read = [name, bytes, limits = limits_] { return scene::parseDocument(name, *bytes, limits); };
         if (isAsLoaded()) request.is_known = comparison();
       });
}

void SolveLoop::loadFile(std::string path, Client client, Callback<LoadOutcome> done) {
  load(std::move(client), std::move(done), [this, path = std::move(path)](LoadJob::Request& request) {
    request.read = [path, limits = limits_] { return scene::loadDocument(path, limits); };
    if (isAsLoaded()) request.is_known = comparison();
  });
}

void SolveLoop::beginLoad(LoadJob::Request request) {
  callOffLoad("another scene is being loaded");
  const auto done = request.done;
  const auto refuse = [&](const Error& error) {
    tellStatus();
    done(tl::unexpected<Error>(error));
    runDeferred();
  };
  if (called_off_) return refuse(cancelled("the server is shutting down"));
  LoadJob::Options options{settings_, options_.first_light_above, lit_ ? 0 : options_.first_texels, limits_, {}};
  if (options_.store)
    options.keep_ahead = [store = options_.store](const auto& document) {
      return store->writeAhead(plainDocument(document));
    };
  const auto wake = [this] { queue_.wake(); };
  try {
    load_ = std::make_unique<LoadJob>(std::move(request), options, *transport_, wake, std::move(former_load_));
  } catch (const std::system_error& error) {
    return refuse({ErrorCode::kUnavailable, std::string("no thread to load with: ") + error.what(), {}});
  } catch (const std::bad_alloc&) {
    return refuse({ErrorCode::kTooLarge, "the server has no memory to load with", {}});
  }
  {
    const std::scoped_lock lock(mutex_);
    load_task_ = load_->task();
    if (called_off_) load_->cancel();  // meanwhile
  }
  load_told_ = -1.0;
  updateStatus(true);
}

/// Whoever waits for the end of a load is answered, be there memory to tell the others of it or not.
void SolveLoop::tellStatus() {
  if (!fitsMemory([&] { updateStatus(true); })) log::warn("out of memory: the end of a load is told later");
}

void SolveLoop::callOffLoad(const std::string& why) {
  if (!load_) return;
  former_load_ = std::move(load_);  // the one before it was its own
  former_load_->cancel();
  if (std::exchange(settling_, std::nullopt)) putBack();
  (void)former_load_->take();  // what it has made may be large
  if (first_light_) unload(SolveState::kEmpty);
  tellStatus();
  former_load_->request().done(tl::unexpected<Error>(cancelled(why)));
}

void SolveLoop::callOff() {
  called_off_ = true;
  {
    const std::scoped_lock lock(mutex_);
    if (load_task_) load_task_->cancel();
  }
  queue_.wake();  // for the solve thread to see it
  long_work_->callOff();
}

/// One that is called off is answered at once: what its thread is at may take it a while yet to leave.
void SolveLoop::loadTurn() {
  if (load_->task()->isCancelled()) {
    callOffLoad(called_off_ ? "the server is shutting down" : "its client has gone");
    return runDeferred();
  }
  if (settling_) {
    if (!transport_->hasTakenScene() && Clock::now() < settling_->deadline) return;
    auto made = std::move(settling_->made);
    settling_.reset();
    return endLoad(std::move(made), Upload::kBegun);
  }
  auto ready = load_->take();
  if (ready.first_light && !lit_ && !withinMemory([&] { return showFirstLight(std::move(ready.first_light)); })) {
    first_light_.reset();  // then all at once, or the reason why not
    lit_.reset();
  }
  if (ready.known) return endKnown(std::move(*ready.known));
  if (ready.whole) return settle(std::move(*ready.whole));
  const double fraction = load_->task()->fraction();
  if (fraction == load_told_ || Clock::now() < next_progress_) return;
  load_told_ = fraction;
  updateStatus(true);
}

/// What came is what is there; unless that was edited meanwhile, and counts as another.
void SolveLoop::endKnown(scene::Document document) {
  auto& request = load_->request();
  if (!lit_ || (!request.goes_on_edited && !isAsLoaded())) {
    LoadJob::Request anew{{}, request.client, request.done};
    anew.read = [document = std::move(document)]() -> Result<scene::Document> { return document; };
    request.done = [](const auto&) {};  // the new one answers
    return beginLoad(std::move(anew));
  }
  const auto job = std::move(load_);
  tellStatus();
  job->request().done(LoadOutcome{revision_, lit_->warnings()});
  runDeferred();
}

/// Renderers take in a large scene for a second, which no edit of the one before is to wait for.
void SolveLoop::settle(Result<std::unique_ptr<LitScene>> whole) {
  if (!whole || !lit_ || first_light_) return endLoad(std::move(whole), Upload::kNow);
  const auto begun = withinMemory([&] { return (*whole)->beginUpload(); });
  if (begun) {
    settling_.emplace(Settling{std::move(*whole), Clock::now() + kSettlingPatience});
    return;
  }
  whole->reset();  // before the other takes its place again
  putBack();
  endLoad(tl::unexpected<Error>(begun.error()), Upload::kNow);
}

void SolveLoop::endLoad(Result<std::unique_ptr<LitScene>> whole, Upload upload) {
  const auto job = std::move(load_);
  const auto& request = job->request();
  const auto outcome = withinMemory([&] { return settleIn(std::move(whole), request.client.name, upload); });
  if (!outcome && first_light_) unload(SolveState::kEmpty);
  if (!outcome) tellStatus();
  request.done(outcome);
  runDeferred();
}

bool SolveLoop::awaitsLoad(Needs needs, std::uint64_t session) const {
  if (!load_) return false;
  const bool is_own = session != 0 && session == load_->request().client.session;
  switch (needs) {
    case Needs::kScene:
      return !lit_ || (is_own && !first_light_);
    case Needs::kWhole:
      return !lit_ || first_light_ || is_own;
    case Needs::kNoLoad:
      break;
  }
  return true;
}

void SolveLoop::whenLoaded(Needs needs, std::uint64_t session, CommandQueue::Command command,
                           const std::function<void()>& refuse) {
  if (!awaitsLoad(needs, session)) return command();
  if (deferred_.size() >= kMostDeferred) return refuse();
  deferred_.push_back(std::move(command));
}

void SolveLoop::runDeferred() {
  for (const auto& command : std::exchange(deferred_, {})) {
    if (queue_.closed()) return;
    runCommand(command);
  }
}

Result<LoadOutcome> SolveLoop::settleIn(Result<std::unique_ptr<LitScene>> made, const std::string& by, Upload upload) {
  if (!made) return tl::unexpected<Error>(made.error());
  const bool announced = lit_ && first_light_;
  const auto revision = announced ? revision_ : revision_ + 1;
  auto next = History::nextLoad(revision, by, (*made)->document().name);
  const auto keep = [&](const LitScene& lit, const LitScene::Affected&) { return keepLoad(next, lit.document()); };
  history_.makeRoom();
  const auto relation = announced ? Relation::kSolvedAnew : Relation::kOther;
  if (const auto lit = relight(std::move(made), relation, keep, upload); !lit)
    return tl::unexpected<Error>(lit.error());
  first_light_.reset();
  revision_ = revision;
  lost_told_ = 0;
  history_.take(std::move(next));
  LoadOutcome outcome{revision_, {}};
  const bool begun = fitsMemory([&] { beginSolve(); });
  const bool warned = fitsMemory([&] {
    const LogScope about({.revision = revision_});
    outcome.warnings = lit_->warnings();
    for (const auto& warning : outcome.warnings) log::warn("{}", warning);
  });
  const bool told = fitsMemory([&] {
    listeners_.tell([this](Listener& listener) { listener.onSceneLoaded(revision_); });
    publishLightmaps(false);
  });
  if (!begun || !warned || !told) {
    unpublished_ = true;
    log::warn("out of memory: a scene is loaded, viewers will see it later");
  }
  next_publish_ = Clock::now();  // those pages are black: the first light is not kept waiting for what they took
  return outcome;
}

// ---- first light ----

/// Only where there was no scene: whoever watches one goes on with it until the next is there, and so does the server
/// when that cannot be had.
Result<void> SolveLoop::showFirstLight(std::unique_ptr<LitScene> few) {
  if (const auto lit = relight(std::move(few), Relation::kOther); !lit) return tl::unexpected<Error>(lit.error());
  first_light_ = FirstLight();
  ++revision_;
  updateStatus(true);
  listeners_.tell([this](Listener& listener) { listener.onSceneLoaded(revision_); });
  unpublished_ = true;
  publishLightmaps(false);  // the geometry is there to be looked at
  next_publish_ = Clock::now();
  return {};
}

void SolveLoop::firstLightSlice() {
  if (!first_light_->goes_on) return;
  const auto outcome = stepSolver();
  if (queue_.closed()) return;
  tellLosses();
  first_light_->goes_on =
      outcome && *outcome != solver::StepOutcome::kConverged && *outcome != solver::StepOutcome::kExhausted;
  unpublished_ |= outcome && *outcome != solver::StepOutcome::kSlice;
  if (unpublished_ && (Clock::now() >= next_publish_ || !first_light_->goes_on)) publishLightmaps(false);
}

/// The whole of a scene cannot be had whose first light was shown: nothing is there, as before.
void SolveLoop::unload(SolveState state) {
  dropRefinement();
  first_light_.reset();
  former_.reset();
  lit_.reset();
  retired_.reset();
  probes_.letGo();
  as_restored_ = false;
  state_ = state;
  owes_pages_.reset();
  publisher_.reset();
  publisher_.startVersion();
  for (std::size_t q = 0; q < kQuantityCount; ++q) {
    if (!lightmaps_[q]) continue;  // written by this thread alone
    const auto nothing = publisher_.publish({static_cast<Quantity>(q), {}, {}, false}, Status{}, false);
    {
      const std::scoped_lock lock(mutex_);
      lightmaps_[q] = nothing;
    }
    listeners_.tell([&](Listener& listener) { listener.onLightmaps(nothing); });
  }
  updateStatus(true);
}

}  // namespace radiosity::engine
