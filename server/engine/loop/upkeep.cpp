#include "server/engine/loop/upkeep.h"

#include <algorithm>

#include "common/log.h"

namespace radiosity::engine {
namespace {

constexpr auto kLongestWait = std::chrono::seconds(30);

}  // namespace

bool Upkeep::isDue() {
  const auto now = Clock::now();
  if (now < next_) return false;
  next_ = now + kInterval;
  return true;
}

bool Upkeep::checkState() {
  if (!store_) return false;
  const auto here = store_->check();
  auto trouble = here ? std::string() : here.error().text();
  if (trouble == state_trouble_) return false;
  state_trouble_ = std::move(trouble);
  if (here) {
    log::info("{}: the state's folder is back, edits are taken again", store_->folder().string());
  } else {
    log::error("edits are refused: {}", state_trouble_);
  }
  return true;
}

bool Upkeep::wantsRenderers(solver::Transport& transport) {
  renderers_ = transport.look();
  return renderers_.missing > 0 && Clock::now() >= next_replacement_;
}

void Upkeep::addTo(Status& status) const {
  const bool idle = status.state != SolveState::kSolving;  // else the next batch replaces those that are missing
  status.renderers = renderers_.wanted;
  status.renderers_missing = idle ? renderers_.missing : 0;
  status.renderer_trouble = idle ? renderers_.why : std::string();
  status.state_trouble = state_trouble_;
}

void Upkeep::replaceRenderers(solver::Transport& transport) {
  const auto replaced = transport.replaceMissing();
  renderers_ = transport.look();
  if (replaced) {
    next_replacement_ = Clock::time_point::min();
    replacement_wait_ = kInterval;
    return;
  }
  log::warn("renderers are missing: {}", replaced.error().text());
  replacement_wait_ = std::min<Clock::duration>(2 * replacement_wait_, kLongestWait);
  next_replacement_ = Clock::now() + replacement_wait_;
}

}  // namespace radiosity::engine
