// What happens when renderers are lost. A transport replaces those that die or hang by itself; where it cannot (a
// driver that resets, a graphics card without memory) the solve starts over on new contexts after a while, with the
// same bits as one that was never disturbed. Nobody is disconnected.
#include <algorithm>
#include <thread>

#include "common/log.h"
#include "server/engine/loop/solve_loop_class.h"

namespace radiosity::engine {
namespace {

/// Times in a row that a solve starts over: a scene that ends every renderer would do so for ever.
constexpr unsigned kMaxRecoveries = 4;
constexpr auto kNap = std::chrono::milliseconds(20);  ///< commands do not wait longer

}  // namespace

bool SolveLoop::willRecover(const Error& error) {
  if (error.code != ErrorCode::kUnavailable || recoveries_ >= kMaxRecoveries) return false;
  const auto wait = options_.recovery_wait * (1U << recoveries_++);
  renderer_lost_ = true;
  retry_at_ = Clock::now() + wait;
  failure_ = error.text();
  const LogScope about({.revision = revision_});
  log::warn("no renderer is left: {}; the solve starts over in {} ms", failure_, wait.count());
  updateStatus(true);
  if (owes_pages_) publishLightmaps(false);
  return true;
}

bool SolveLoop::rendererIsBack() {
  if (Clock::now() < retry_at_) {
    std::this_thread::sleep_for(kNap);
    return false;
  }
  auto uploaded = lit_->upload();
  tellLosses();
  if (queue_.closed()) return false;
  if (!uploaded) {
    if (willRecover(uploaded.error())) return false;
    failure_ = uploaded.error().text();
    log::error("solve stopped: {}", failure_);
    endSolve(SolveState::kFailed);
    return false;
  }
  const Notice notice{Notice::Kind::kSolveRestarted,
                      "all renderers were lost (" + failure_ + "); the solve starts over"};
  renderer_lost_ = false;
  ++solve_restarts_;
  lit_->restart(settings_);
  const double spent = seconds_;  // a time limit holds for all attempts together
  beginSolve();
  seconds_ = spent;
  listeners_.tell([&](Listener& listener) { listener.onNotice(notice); });
  return true;
}

void SolveLoop::tellLosses() {
  const auto losses = transport_->losses();
  if (losses.count == losses_told_) return;
  losses_told_ = losses.count;
  const Notice notice{Notice::Kind::kRendererReplaced, losses.last + "; it was replaced and its work is done again"};
  listeners_.tell([&](Listener& listener) { listener.onNotice(notice); });
}

void SolveLoop::lookAfter() {
  if (!upkeep_.isDue()) return;
  const bool looked = fitsMemory([&] {
    if (upkeep_.checkState()) updateStatus(true);
    lookAfterRenderers();
  });
  if (!looked) log::warn("out of memory: what may break by itself is looked after later");
}

/// A solve that is under way replaces its renderers itself, and so does one that lost them all.
void SolveLoop::lookAfterRenderers() {
  if (state_ == SolveState::kSolving || first_light_ || renderer_lost_) return;
  const auto missing = upkeep_.renderers().missing;
  const bool wanted = upkeep_.wantsRenderers(*transport_);
  if (wanted || upkeep_.renderers().missing != missing) updateStatus(true);
  if (!wanted) return;
  upkeep_.replaceRenderers(*transport_);
  if (queue_.closed()) return;
  tellLosses();
  updateStatus(true);
}

void SolveLoop::beat() { last_beat_ = Clock::now().time_since_epoch().count(); }

double SolveLoop::busySeconds() const {
  if (waiting_) return 0.0;
  const Clock::duration since(Clock::now().time_since_epoch().count() - last_beat_);
  return std::max(0.0, std::chrono::duration<double>(since).count());
}

}  // namespace radiosity::engine
