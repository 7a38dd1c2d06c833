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
/// Another layout is worth it where it is to have so many times as many texels.
constexpr double kWorthwhile = 1.05;

}  // namespace

void SolveLoop::beginRefinement(SolveState otherwise, std::string why) {
  refinement_.emplace(Refinement{otherwise, std::move(why), nullptr});
  publishLightmaps(false);
  tellProgress(true);
}

void SolveLoop::refineSlice() {
  const auto begin = Clock::now();
  if (refinement_->job) {
    takeRefined();
  } else {
    lit_->probeSurface(kProbeSeconds);
    if (!lit_->lacksSurface()) judgeTexels();
  }
  seconds_ += std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Ends the solve where that has what was asked for, or can have no more of it.
void SolveLoop::judgeTexels() {
  const double left = lit_->surfaceError()->total;
  if (left <= settings_.target_error) return endRefinement(SolveState::kConverged, {});
  if (settings_.time_limit_s && seconds_ >= *settings_.time_limit_s) return endRefinement(SolveState::kTimeLimit, {});
  auto wanted = lit_->wantedTexels();
  const auto texels = static_cast<double>(lit_->patchCount());
  const bool is_worthwhile = lit_->draftError() > 0.0 || wanted.texels >= kWorthwhile * texels;
  if (refined_times_ < kMostLayouts && is_worthwhile) return orderRefined(std::move(wanted));
  if (refinement_->otherwise == SolveState::kLimited) return endRefinement(SolveState::kLimited, refinement_->why);
  endRefinement(SolveState::kLimited, fmt::format("texels: {:.0f} of {} are used, and {:.2g} % are left at the surface",
                                                  texels, settings_.texels, 100.0 * left));
}

void SolveLoop::endRefinement(SolveState state, std::string why) {
  dropRefinement();
  failure_ = std::move(why);
  if (!failure_.empty()) log::warn("the solve ends above its target error: {}", failure_);
  endSolve(state);
}

/// The last layout there can be is no draft.
void SolveLoop::orderRefined(WantedTexels wanted) {
  const bool is_last = wanted.error <= settings_.target_error || refined_times_ + 1 == kMostLayouts ||
                       wanted.texels > kNearlyAll * static_cast<double>(settings_.texels);
  try {
    RefineJob::Order order{lit_->sharedDocument(), settings_, limits_, std::move(wanted.layout),
                           is_last ? 0.0 : wanted.error};
    refinement_->job = std::make_unique<RefineJob>(std::move(order), *transport_, [this] { queue_.wake(); });
  } catch (const std::system_error& error) {
    keepTexels(error.what());
  }
}

/// None take their place: light is solved for as well as was asked for on those that there are.
void SolveLoop::keepTexels(const std::string& why) {
  log::warn("texels stay as they are: {}", why);
  dropRefinement();
  refined_times_ = kMostLayouts;
  lit_->setDraft(0.0);
  lit_->retarget(settings_);
}

/// What there is has light; with no time left for more, another layout would be dark.
void SolveLoop::takeRefined() {
  auto made = refinement_->job->take();
  if (!made) return;
  seconds_ += refinement_->job->seconds();
  if (isOutOfTime()) return endRefinement(SolveState::kTimeLimit, {});
  dropRefinement();
  ++refined_times_;
  const auto lit = relight(std::move(*made), Relation::kSolvedAnew, {}, uploadOfEdit());
  if (!lit) {
    if (state_ == SolveState::kFailed && lit.error().code == ErrorCode::kUnavailable) {
      state_ = SolveState::kSolving;
      if (willRecover(lit.error())) return;
      state_ = SolveState::kFailed;
    }
    return state_ == SolveState::kSolving ? keepTexels(lit.error().text()) : void();
  }
  unpublished_ = true;
  publishLightmaps(false);
  updateStatus(true);
}

/// Nobody waits for what a thread is at that lays texels out.
void SolveLoop::dropRefinement() {
  if (refinement_ && refinement_->job) {
    refinement_->job->cancel();
    disposer_.dispose(std::move(refinement_->job));
  }
  refinement_.reset();
}

}  // namespace radiosity::engine
