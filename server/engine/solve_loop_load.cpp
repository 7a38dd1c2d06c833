// Loading a scene. Making millions of texels takes many seconds, and their first light takes more: of such a scene
// those who watch are shown its first light on few texels, while all are made in a thread of their own. Whatever is
// promised (answers, stated errors, waits, checkpoints, the bits of the result) holds for the whole alone: until it is
// there the state is kLoading, and whoever asks for a change waits for it.
#include <algorithm>
#include <string>
#include <system_error>
#include <utility>

#include "common/log.h"
#include "server/engine/solve_loop_class.h"

namespace radiosity::engine {
namespace {

/// Stated error from which on more shots make no visible difference on few texels.
constexpr double kFirstLightError = 0.03;

}  // namespace

Engine::Callback<LoadOutcome> SolveLoop::countLoad(Callback<LoadOutcome> done) {
  ++loads_;
  return [this, done = std::move(done)](Result<LoadOutcome> outcome) {
    --loads_;
    done(std::move(outcome));
  };
}

void SolveLoop::load(Callback<LoadOutcome> done, std::function<LoadBegun()> begin) {
  const auto answer = std::make_shared<Callback<LoadOutcome>>(countLoad(std::move(done)));
  const auto run = [this, answer, begin = std::move(begin)] {
    endFirstLight();  // of a scene before
    auto begun = withinMemory(begin);
    if (!begun) return (*answer)(tl::unexpected<Error>(begun.error()));
    if (*begun) return (*answer)(std::move(**begun));
    first_light_->done = std::move(*answer);
  };
  if (queue_.push(run)) return;
  (*answer)(fail(ErrorCode::kBusy, "too many requests are waiting for the solver, try again"));
}

void SolveLoop::loadBytes(std::string name, SharedBytes bytes, std::string by, Callback<LoadOutcome> done) {
  load(std::move(done), [this, name = std::move(name), bytes = std::move(bytes), by = std::move(by)] {
    return install(scene::parseDocument(name, *bytes, limits_), by);
  });
}

void SolveLoop::loadFile(std::string path, std::string by, Callback<LoadOutcome> done) {
  load(std::move(done),
       [this, path = std::move(path), by = std::move(by)] { return install(scene::loadDocument(path, limits_), by); });
}

auto SolveLoop::install(Result<scene::Document> document, const std::string& by) -> LoadBegun {
  if (!document) return tl::unexpected<Error>(document.error());
  if (goesOnWith(*document, false)) return LoadOutcome{revision_, lit_->warnings()};
  const SolveState before = std::exchange(state_, SolveState::kLoading);
  const auto refuse = [&](const Error& error) {
    if (state_ == SolveState::kLoading) state_ = before;
    updateStatus(true);
    return tl::unexpected<Error>(error);
  };
  updateStatus(true);
  auto edited = withinMemory([&] { return scene::importEdited(std::move(*document), nullptr, limits_); });
  if (!edited) return refuse(edited.error());
  if (wantsFirstLight(edited->scene)) {
    if (withinMemory([&] { return showFirstLight(*edited, by); })) return std::nullopt;
    first_light_.reset();  // then all at once, or the reason why not
    lit_.reset();
  }
  auto settled = settleIn(withinMemory([&] { return LitScene::make(std::move(*edited), settings_, *transport_); }), by);
  if (!settled) return refuse(settled.error());
  return std::move(*settled);
}

Result<LoadOutcome> SolveLoop::settleIn(Result<std::unique_ptr<LitScene>> made, const std::string& by) {
  if (!made) return tl::unexpected<Error>(made.error());
  const bool announced = lit_ && first_light_;
  const auto revision = announced ? revision_ : revision_ + 1;
  auto next = History::nextLoad(revision, by, (*made)->document().name);
  const auto keep = [&](const LitScene& lit, const LitScene::Affected&) { return keepLoad(next, lit.document()); };
  history_.makeRoom();
  const auto relation = announced ? Relation::kSolvedAnew : Relation::kOther;
  if (const auto lit = relight(std::move(made), relation, keep); !lit) return tl::unexpected<Error>(lit.error());
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
bool SolveLoop::wantsFirstLight(const scene::Scene& scene) const {
  if (lit_ || options_.first_texels == 0) return false;
  scene::ChartOptions charts;
  charts.texel_budget = settings_.texels;
  charts.texel_size_m = settings_.texel_size_m;
  const auto leaves = scene::expectedLeaves(scene, charts);
  return leaves > options_.first_light_above && leaves > options_.first_texels && leaves <= scene::kMaxLeaves;
}

Result<void> SolveLoop::showFirstLight(const scene::EditedDocument& edited, const std::string& by) {
  auto settings = settings_;
  settings.texels = options_.first_texels;
  settings.texel_size_m = 0.0;
  settings.target_error = std::max(kFirstLightError, settings.target_error);
  auto shown = LitScene::make(edited, settings, *transport_);
  if (const auto lit = relight(std::move(shown), Relation::kOther); !lit) return tl::unexpected<Error>(lit.error());
  FirstLight first;
  first.by = by;
  first.made = std::make_shared<std::atomic<bool>>(false);
  first_light_ = std::move(first);
  if (auto begun = makeWhole(edited); !begun) return begun;
  ++revision_;
  updateStatus(true);
  listeners_.tell([this](Listener& listener) { listener.onSceneLoaded(revision_); });
  unpublished_ = true;
  publishLightmaps(false);  // the geometry is there to be looked at
  next_publish_ = Clock::now();
  return {};
}

Result<void> SolveLoop::makeWhole(const scene::EditedDocument& edited) {
  auto make = [this, edited, settings = settings_, &transport = *transport_, made = first_light_->made]() mutable {
    struct Tell {  // also of what is thrown
      CommandQueue& queue;
      std::atomic<bool>& made;
      ~Tell() {
        made = true;
        try {
          (void)queue.push([] {});  // wakes the solve thread; one whose queue is full is awake
        } catch (const std::bad_alloc&) {
          log::warn("out of memory: the solve thread will see later that the scene is there");
        }
      }
    };
    const Tell tell{queue_, *made};
    return withinMemory([&] { return LitScene::make(std::move(edited), settings, transport); });
  };
  try {
    first_light_->whole = std::async(std::launch::async, std::move(make));
  } catch (const std::system_error& error) {
    return fail(ErrorCode::kUnavailable, std::string("no thread to load with: ") + error.what());
  }
  return {};
}

void SolveLoop::firstLightSlice() {
  if (*first_light_->made) return endFirstLight();
  if (!first_light_->goes_on) return;
  const auto outcome = stepSolver();
  if (queue_.closed()) return;
  tellLosses();
  first_light_->goes_on =
      outcome && *outcome != solver::StepOutcome::kConverged && *outcome != solver::StepOutcome::kExhausted;
  unpublished_ |= outcome && *outcome != solver::StepOutcome::kSlice;
  if (unpublished_ && (Clock::now() >= next_publish_ || !first_light_->goes_on)) publishLightmaps(false);
}

void SolveLoop::endFirstLight() {
  if (!first_light_) return;
  const auto done = std::move(first_light_->done);
  const auto by = std::move(first_light_->by);
  const auto outcome = withinMemory([&]() -> Result<LoadOutcome> {
    try {
      return settleIn(first_light_->whole.get(), by);
    } catch (const std::system_error& error) {
      return fail(ErrorCode::kUnavailable, std::string("no thread to load with: ") + error.what());
    }
  });
  if (first_light_) unload(SolveState::kEmpty);
  done(outcome);
}

/// The whole of a scene cannot be had whose first light was shown: nothing is there, as before.
void SolveLoop::unload(SolveState state) {
  first_light_.reset();
  former_.reset();
  lit_.reset();
  retired_.reset();
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
