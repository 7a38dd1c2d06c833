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

/// Layouts after one another: each of the first few halves what is missing, about.
constexpr int kMostRounds = 4;
/// Of measuring what people see, between two looks at what else there is to do.
constexpr double kProbeSeconds = 0.02;
/// With more of the texels that there may be than this there is no other layout to come.
constexpr double kNearlyAll = 0.8;
/// Another layout is worth it where it is to have so many times as many texels.
constexpr double kWorthwhile = 1.05;

}  // namespace

bool SolveLoop::mayRefine() const {
  const bool out_of_time = settings_.time_limit_s && seconds_ >= *settings_.time_limit_s;
  return settings_.choosesTexels() && lit_ && refined_times_ < kMostRounds && !out_of_time;
}

void SolveLoop::beginRefinement(SolveState otherwise) {
  refinement_.emplace(Refinement{otherwise, nullptr});
  publishLightmaps(false);
  tellProgress(true);
}

void SolveLoop::refineSlice() {
  const auto begin = Clock::now();
  if (refinement_->job) {
    takeRefined();
  } else {
    lit_->probeSurface(kProbeSeconds);
    if (lit_->surfaceError()) orderRefined();
  }
  seconds_ += std::chrono::duration<double>(Clock::now() - begin).count();
}

/// Ends the solve where that has what was asked for, or can have no more of it.
void SolveLoop::orderRefined() {
  const auto otherwise = refinement_->otherwise;
  const bool is_draft = lit_->isDraft();
  if (lit_->surfaceError()->total <= settings_.target_error && !is_draft) {
    refinement_.reset();
    return endSolve(SolveState::kConverged);
  }
  auto wanted = lit_->wantedTexels();
  const auto texels = static_cast<double>(lit_->patchCount());
  if (!is_draft && wanted.texels < kWorthwhile * texels) {
    refinement_.reset();
    failure_ = fmt::format("texels: {:.0f} of {} are used, and {:.2g} % are left at the surface", texels,
                           settings_.texels, 100.0 * lit_->surfaceError()->total);
    return endSolve(otherwise == SolveState::kConverged ? SolveState::kLimited : otherwise);
  }
  try {
    const bool suffices =
        wanted.error <= settings_.target_error || wanted.texels > kNearlyAll * static_cast<double>(settings_.texels);
    RefineJob::Order order{lit_->sharedDocument(), settings_, limits_, std::move(wanted.of_surface),
                           suffices ? 0.0 : wanted.error};
    refinement_->job = std::make_unique<RefineJob>(std::move(order), *transport_, [this] { queue_.wake(); });
    refinement_->ordered = Clock::now();
  } catch (const std::system_error& error) {
    log::warn("texels stay as they are: no thread to lay them out with: {}", error.what());
    refinement_.reset();
    endSolve(otherwise);
  }
}

void SolveLoop::takeRefined() {
  auto made = refinement_->job->take();
  if (!made) return;
  const auto otherwise = refinement_->otherwise;
  seconds_ += std::chrono::duration<double>(Clock::now() - refinement_->ordered).count();
  refinement_.reset();
  ++refined_times_;
  if (const auto lit = relight(std::move(*made), Relation::kSolvedAnew, {}, uploadOfEdit()); !lit) {
    log::warn("texels stay as they are: {}", lit.error().text());
    refined_times_ = kMostRounds;
    return endSolve(otherwise);
  }
  former_.reset();  // its texels are others
  unpublished_ = true;
  publishLightmaps(false);
  updateStatus(true);
}

}  // namespace radiosity::engine
