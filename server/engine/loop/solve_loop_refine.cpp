// Texels that the program chooses: after a solve on few of them it is measured what people would see, and a layout that
// is finer where light wants it takes the place of the one before, until the error that was asked for is reached.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <system_error>
#include <utility>

#include "common/log.h"
#include "server/engine/loop/solve_loop_class.h"

namespace radiosity::engine {
namespace {

/// With more of the texels that there may be than this there is no other layout to come.
constexpr double kNearlyAll = 0.8;
/// Texels that leave less than so much of the target stay: to solve for light on them more closely takes less than to
/// begin anew on others.
constexpr double kFineEnough = 0.9;
/// Of the square of a target that was missed, what is aimed at.
constexpr double kNearTarget = 0.95;
/// Another layout, be it of more texels or of as many elsewhere, is worth it where it is to leave no more than so much.
constexpr double kWorthwhile = 0.9;

/// Of what light on texels is off by now, at the surface, what it may be off by there. `left`: it and texels together.
double noiseShare(double left, double texels, double target) {
  constexpr double kLeast = 0.5, kMost = 0.9;  // what is measured is by chance off by some hundredths
  const double now = left * left - texels * texels, wanted = kNearTarget * target * target - texels * texels;
  return now > 0.0 && wanted > 0.0 ? std::clamp(std::sqrt(wanted / now), kLeast, kMost) : kLeast;
}

/// More of them would be a promise. Above 0.
double inTwoDigits(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 1.0);
  return unit * std::round(value / unit);
}

}  // namespace

void SolveLoop::beginRefinement(SolveState otherwise, std::string why) {
  refinement_.emplace(Refinement{otherwise, std::move(why), nullptr});
  publishLightmaps(false);
  tellProgress(true);
}

void SolveLoop::refineSlice() {
  const auto begin = Clock::now();
  if (refinement_->job && !refinement_->job->isDone() && isOutOfTime())
    return endRefinement(SolveState::kTimeLimit, {});
  if (refinement_->job) {
    takeRefined();
  } else {
    lit_->probeSurface(kProbeSeconds, isOutOfTime());
    if (!lit_->lacksSurface()) {
      updateStatus(true);  // who waits for no more than this goes on
      judgeTexels();
    }
  }
  seconds_ += std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Ends the solve where that has what was asked for, or can have no more of it.
void SolveLoop::judgeTexels() {
  const auto surface = *lit_->surfaceError();
  const double left = surface.total, aim = aimAtSurface(surface, settings_.target_error);
  if (coarser_ && !isWorseThanCoarser(left)) disposer_.dispose(std::exchange(coarser_, nullptr));
  if (left <= aim) return endRefinement(SolveState::kConverged, {});
  const bool is_reached = left <= settings_.target_error;  // though not by 95 % of places
  if (is_reached && (isOutOfTime() || refinement_->otherwise == SolveState::kLimited))
    return endRefinement(SolveState::kConverged, {});
  if (isOutOfTime()) return endRefinement(SolveState::kTimeLimit, {});
  auto wanted = lit_->wantedTexels(aim);
  const bool is_worthwhile = wanted.present > 0.0 && wanted.error <= kWorthwhile * wanted.present;
  if (lit_->isDraft() && (!is_worthwhile || wanted.present < kFineEnough * aim)) return keepTexels();
  const bool can_solve = refinement_->otherwise != SolveState::kLimited && !lit_->isDraft();
  const double fine = refined_times_ < kMostLayouts && is_worthwhile ? kFineEnough : 1.0;
  if (can_solve && wanted.present < fine * aim && lit_->solveCloser(noiseShare(left, wanted.present, aim)))
    return callOffRefinement();
  if (refined_times_ < kMostLayouts && is_worthwhile) return orderRefined(std::move(wanted), aim);
  if (is_reached) return endRefinement(SolveState::kConverged, {});
  if (refinement_->otherwise == SolveState::kLimited) return endRefinement(SolveState::kLimited, refinement_->why);
  takeBetterLayout(left);
  endRefinement(SolveState::kLimited, lackOfTexels());
}

std::string SolveLoop::lackOfTexels() const {
  auto why = fmt::format("texels: {} of {} are used, and {:.2g} % are left at the surface", lit_->patchCount(),
                         settings_.texels, 100.0 * lit_->surfaceError()->total);
  const auto enough = lit_->enoughTexels(settings_.target_error);
  if (enough && *enough > static_cast<double>(settings_.texels))
    why += fmt::format("; about {:.0f} would reach {:.2g} %", inTwoDigits(*enough), 100.0 * settings_.target_error);
  return why;
}

bool SolveLoop::isWorseThanCoarser(double error) const {
  return coarser_ && coarser_->surfaceError() && error > coarser_->surfaceError()->total;
}

/// Light on many texels is worse than that on fewer was where time or memory end before it is solved for as well.
void SolveLoop::takeBetterLayout(double error) {
  if (!isWorseThanCoarser(error)) return;
  const auto back = relight(std::move(coarser_), Relation::kResumed);
  if (!back) log::warn("the light of coarser texels, which is better, cannot be had: {}", back.error().text());
}

void SolveLoop::endRefinement(SolveState state, std::string why) {
  callOffRefinement();
  if (state != SolveState::kConverged && lit_->surfaceError()) takeBetterLayout(lit_->surfaceError()->total);
  dropRefinement();
  failure_ = std::move(why);
  if (!failure_.empty()) log::warn("the solve ends above its target error: {}", failure_);
  endSolve(state);
}

/// The last layout there can be is no draft.
void SolveLoop::orderRefined(WantedTexels wanted, double aim) {
  log::info("{} texels leave {:.2g} % at the surface after {:.2f} s, {:.2g} % by themselves: {:.0f} are laid out",
            lit_->patchCount(), 100.0 * lit_->surfaceError()->total, seconds_, 100.0 * wanted.present, wanted.texels);
  const bool is_last = wanted.error <= aim || refined_times_ + 1 == kMostLayouts ||
                       wanted.texels > kNearlyAll * static_cast<double>(settings_.texels);
  try {
    RefineJob::Order order{lit_->sharedDocument(), settings_, limits_, std::move(wanted.layout),
                           is_last ? 0.0 : std::max(wanted.error, kPilotDraft)};
    refinement_->job = std::make_unique<RefineJob>(std::move(order), *transport_, [this] { queue_.wake(); });
  } catch (const std::system_error& error) {
    giveUpTexels(error.what());
  }
}

void SolveLoop::giveUpTexels(const std::string& why) {
  log::warn("texels stay as they are: {}", why);
  refined_times_ = kMostLayouts;
  keepTexels();
}

/// There is none to measure with, or to lay texels out in. Does not throw: what takes it calls this.
void SolveLoop::endWithoutMemory() {
  if (refined_times_ < kMostLayouts && fitsMemory([&] { giveUpTexels("out of memory"); })) return;
  refinement_.reset();
  refined_times_ = kMostLayouts;
  const bool told = fitsMemory([&] {
    failure_ = "there is no memory to measure what is left at the surface";
    endSolve(SolveState::kLimited);
  });
  if (!told) state_ = SolveState::kLimited;
}

/// None take their place: light is solved for as well as was asked for on those that there are.
void SolveLoop::keepTexels() {
  callOffRefinement();
  lit_->setDraft(0.0);
  lit_->retarget(settings_);
}

/// What there is has light; with no time left for more, another layout would be dark.
void SolveLoop::takeRefined() {
  auto made = refinement_->job->take();
  if (!made) return;
  seconds_ += refinement_->job->seconds();
  const auto& measured = lit_->surfaceError();
  const double shown = measured ? measured->total : 1.0;
  callOffRefinement();
  if (isOutOfTime()) return endRefinement(SolveState::kTimeLimit, {});
  ++refined_times_;
  const auto lit = relight(std::move(*made), Relation::kRefined, {}, uploadOfEdit());
  if (!lit) {
    if (state_ == SolveState::kFailed && lit.error().code == ErrorCode::kUnavailable) {
      state_ = SolveState::kSolving;
      if (willRecover(lit.error())) return;
      state_ = SolveState::kFailed;
    }
    return state_ == SolveState::kSolving ? giveUpTexels(lit.error().text()) : void();
  }
  lit_->setOldError(shown);
  unpublished_ = true;
  publishLightmaps(false);
  updateStatus(true);
}

/// Nobody waits for what a thread is at that lays texels out.
void SolveLoop::callOffRefinement() {
  if (refinement_ && refinement_->job) {
    refinement_->job->cancel();
    disposer_.dispose(std::move(refinement_->job));
  }
  refinement_.reset();
}

void SolveLoop::dropRefinement() {
  callOffRefinement();
  disposer_.dispose(std::exchange(coarser_, nullptr));
}

bool SolveLoop::isOutOfTime() const {
  const double laying_out = refinement_ && refinement_->job ? refinement_->job->secondsSoFar() : 0.0;
  return settings_.time_limit_s && seconds_ + laying_out >= *settings_.time_limit_s;
}

void SolveLoop::stopInTime() {
  takeBetterLayout(lit_->solver().error().total);
  dropRefinement();
  endSolve(SolveState::kTimeLimit);
}

}  // namespace radiosity::engine
