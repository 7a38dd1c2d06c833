// The way back from an edit of geometry: its undo, a redo, a thing that is moved there and back again. The scene before
// the edit is kept with its solve, which had come to its end: it is shown again at once, with the same bits.
#include <algorithm>
#include <utility>

#include "server/engine/lit/memory.h"
#include "server/engine/loop/solve_loop_class.h"

namespace radiosity::engine {
namespace {

/// A scene of more leaves takes more memory than its undo is worth.
constexpr std::size_t kMostKeptLeaves = std::size_t{1} << 19U;

}  // namespace

bool SolveLoop::isWorthKeeping(const LitScene& lit) const {
  return state_ == SolveState::kConverged && !lit.isStale() && lit.patches().leaves.size() <= kMostKeptLeaves &&
         2 * lit.solver().linkCounters().bytes <= settings_.link_memory_bytes;
}

bool SolveLoop::holdsBoth() const {
  return lit_->solver().linkCounters().bytes + former_->solver().linkCounters().bytes <= settings_.link_memory_bytes;
}

Result<PatchOutcome> SolveLoop::goBack(scene::EditedDocument edited, const SceneChange& change, const Keep& keep) {
  PatchOutcome outcome;
  outcome.revision = revision_ + 1;
  auto scene = std::make_shared<const scene::Scene>(std::move(edited.scene));
  bool keeps_layout = false;
  const std::uint64_t relit = former_->affectedBy(change, *scene);
  const auto ready = withinMemory([&]() -> Result<void> {
    keeps_layout = former_->keepsLayoutOf(*lit_);
    // Pages are new even if nothing is on them.
    outcome.affected_surfaces = std::max<std::uint64_t>({former_->surfacesTouchedSince(*lit_), relit, 1});
    if (!settling_)
      if (auto uploaded = former_->upload(); !uploaded) return uploaded;
    return keep(outcome);
  });
  if (!ready) {
    if (!settling_) putBack();
    return tl::unexpected<Error>(ready.error());
  }
  const bool worth_keeping = isWorthKeeping(*lit_);
  std::swap(lit_, former_);
  if (!worth_keeping) former_.reset();
  ++went_back_;
  if (!keeps_layout) publisher_.reset();
  probes_.letGo();
  renderer_lost_ = renderer_lost_ && settling_;
  if (state_ == SolveState::kFailed) state_ = SolveState::kSolving;  // that was the other's solve
  const bool taken = takeInLight([&] {
    retired_ = lit_->reshade(std::move(edited.document), std::move(scene), change);
    return relit > 0;
  });
  if (!taken) outcome.affected_surfaces = std::max<std::uint64_t>(outcome.affected_surfaces, 1);
  return outcome;
}

}  // namespace radiosity::engine
