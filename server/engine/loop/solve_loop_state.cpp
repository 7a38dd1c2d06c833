// What will outlive this process: keeping edits before they are answered, and checkpoints of the solve.
#include <algorithm>
#include <future>
#include <utility>

#include "common/archive.h"
#include "common/log.h"
#include "server/engine/loop/solve_loop_class.h"
#include "server/engine/persist/checkpoint_head.h"
#include "server/engine/persist/kept_settings.h"

namespace radiosity::engine {
namespace {

/// Taking a checkpoint holds the solve up for no more than one part in so many of its time, writing it the disk.
constexpr int kCheckpointShare = 50, kWriteShare = 10;
/// An edit's first light is worth keeping soon, where that is quick.
constexpr auto kAfterEdit = std::chrono::milliseconds(1000);
constexpr double kSmallCheckpointSeconds = 0.05;
state::Revision plainRevision(const History::Next& next) {
  const auto& entry = next.entry;
  return {entry.revision, static_cast<std::int64_t>(entry.kind),
          entry.by,       entry.summary,
          entry.time_s,   entry.stepped,
          next.patch,     next.appended};
}

/// What a client is told: the file is no place in its message.
tl::unexpected<Error> refused(const Error& error, Upkeep& upkeep) {
  upkeep.hurry();  // that /readyz says so, too
  log::error("a change is refused, it cannot be kept: {}", error.text());
  // A file that is damaged is bad input to this program, and no fault of the client's, who may try again.
  const auto code = error.code == ErrorCode::kBadInput ? ErrorCode::kUnavailable : error.code;
  return fail(code, "nothing is changed, since it could not be kept: " + error.text());
}

}  // namespace

// ---- edits ----

Result<void> SolveLoop::keepLoad(const History::Next& next, const scene::Document& document) {
  if (!options_.store) return {};
  const auto plain = plainDocument(document);
  const auto kept = options_.store->load(plainRevision(next), plain, options_.store->digestOf(plain));
  if (!kept) return refused(kept.error(), upkeep_);
  as_restored_ = false;
  return {};
}

SolveLoop::Keep SolveLoop::keepEdit(const History::Next& next, const Receipt& receipt, const scene::Document& after) {
  kept_answer_.reset();
  if (!options_.store) return [](const PatchOutcome&) -> Result<void> { return {}; };
  state::Store::Change change{plainRevision(next), next.edit, next.forgotten, next.done, {}, {}};
  if (options_.store->wantsDocument()) change.document = plainDocument(after);
  return [this, change = std::move(change), receipt,
          stepped = next.entry.stepped](const PatchOutcome& outcome) mutable -> Result<void> {
    if (!receipt.request_id.empty())
      change.answer = state::Answer{receipt.request_id,        receipt.fingerprint,    outcome.revision,
                                    outcome.affected_surfaces, outcome.affected_shots, stepped};
    const auto kept = options_.store->edit(change);
    if (!kept) return refused(kept.error(), upkeep_);
    kept_answer_ = std::move(change.answer);  // no copy: nothing may fail any more
    as_restored_ = false;
    // Not in the middle of a drag where checkpoints are work.
    if (checkpoints_ && checkpoints_->counters().seconds < kSmallCheckpointSeconds)
      next_checkpoint_ = std::min(next_checkpoint_, Clock::now() + kAfterEdit);
    return {};
  };
}

/// Who asks again after a restart hears what was said before.
void SolveLoop::correctAnswer(PatchOutcome& outcome) {
  if (!kept_answer_) return;
  auto answer = *std::exchange(kept_answer_, std::nullopt);
  if (answer.surfaces == outcome.affected_surfaces && answer.shots == outcome.affected_shots) return;
  const auto kept = answer;
  answer.surfaces = outcome.affected_surfaces;
  answer.shots = outcome.affected_shots;
  const auto corrected = options_.store->correct(answer);
  if (corrected) return;
  log::warn("an edit's answer stays as it was first kept: {}", corrected.error().text());
  outcome.affected_surfaces = kept.surfaces;
  outcome.affected_shots = kept.shots;
}

Result<void> SolveLoop::keepSettings(const SolveSettings& settings) {
  if (!options_.store || keptSettings(settings) == keptSettings(settings_)) return {};
  const auto kept = options_.store->setSettings(keptSettings(settings));
  if (!kept) return refused(kept.error(), upkeep_);
  return {};
}

// ---- checkpoints ----

void SolveLoop::checkpointIfDue() {
  if (!checkpoints_ || !lit_ || first_light_ || Clock::now() < next_checkpoint_) return;
  if (checkpoint_revision_ == revision_ && checkpoint_shots_ == lit_->solver().shots()) return;
  // At its end the solve sleeps: that checkpoint takes the place of one that still waits.
  if (state_ == SolveState::kSolving && checkpoints_->isBusy()) return;
  const auto begin = Clock::now();
  if (!takeCheckpoint()) return;
  const auto taken = Clock::now() - begin;
  const auto written = std::chrono::duration<double>(kWriteShare * checkpoints_->counters().seconds);
  next_checkpoint_ = Clock::now() + std::max({Clock::duration(options_.checkpoint_interval), kCheckpointShare * taken,
                                              std::chrono::duration_cast<Clock::duration>(written)});
}

/// True: nothing is left to be done about it now, be it that none can be had.
bool SolveLoop::takeCheckpoint() {
  // What a failed solver has measured may be a part of what it thinks it has: the checkpoint before stays.
  if (renderer_lost_ || state_ == SolveState::kFailed || lit_->isStale()) return true;
  if (!lit_->isReproducible()) {  // after a restart the solve of a scene whose geometry was edited begins anew
    checkpoint_revision_ = revision_;
    checkpoint_shots_ = lit_->solver().shots();
    return true;
  }
  ArchiveWriter to(options_.checkpoint_bytes);
  auto head = headOf(settings_);
  head.epoch = past_.epoch;
  head.revision = revision_;
  head.seconds = seconds_;
  head.gltf = textOf(lit_->document().gltf);
  head.assets = options_.store->digestOf({{}, {}, lit_->document().buffers, lit_->document().images});
  head.sides = lit_->sides();
  head.layout = lit_->layout();
  head.draft_error = lit_->draftError();
  head.closer = lit_->closer();
  head.layouts = static_cast<std::uint32_t>(refined_times_);
  CheckpointHead::visit(to, head);
  const bool large = lit_->solver().linkCounters().bytes > 2 * options_.checkpoint_bytes;
  if (!large && !lit_->save(to)) return false;
  const bool fits = !large && to.fits();
  if (!fits && !std::exchange(checkpoint_too_large_, true))
    log::warn("the solve needs more than {} MiB: it would begin anew after a restart (--checkpoint-size gives it more)",
              options_.checkpoint_bytes >> 20U);
  if (fits) {
    checkpoint_too_large_ = false;
    checkpoints_->write(to.take());
  }
  checkpoint_revision_ = revision_;
  checkpoint_shots_ = lit_->solver().shots();
  return true;
}

void SolveLoop::keepSolve(std::chrono::milliseconds patience) {
  if (!checkpoints_) return;
  const auto deadline = Clock::now() + patience;
  const auto taken = std::make_shared<std::promise<void>>();
  auto done = taken->get_future();
  const auto take = [this, taken, deadline] {
    // In the middle of something: the steps that end it are short.
    const auto isTaken = [&] {
      return (checkpoint_revision_ == revision_ && checkpoint_shots_ == lit_->solver().shots()) || takeCheckpoint();
    };
    while (lit_ && !first_light_ && !isTaken() && state_ == SolveState::kSolving && Clock::now() < deadline) {
      if (!stepSolver()) break;
    }
    state_ = SolveState::kPaused;  // what would be found from here on is lost
    taken->set_value();
  };
  if (!queue_.push(take)) return;
  if (done.wait_until(deadline) != std::future_status::ready) return;
  if (!checkpoints_->flush(std::chrono::duration_cast<std::chrono::milliseconds>(deadline - Clock::now())))
    log::warn("the end comes before the checkpoint is written: the one before it stays");
}

}  // namespace radiosity::engine
