// What may break while nobody asks for anything: the folder of the state is moved away, idle renderers are killed. The
// solve thread looks for both between two commands, also while it has nothing to do.
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "server/engine/engine.h"
#include "server/solver/transport/transport.h"
#include "server/state/store.h"

namespace radiosity::engine {

class Upkeep {
 public:
  using Clock = std::chrono::steady_clock;
  /// Renderers that died are replaced, and told of, within a second.
  static constexpr auto kInterval = std::chrono::milliseconds(250);

  /// `store`: null where nothing is kept.
  explicit Upkeep(std::shared_ptr<const state::Store> store) : store_(std::move(store)) {}

  /// False within kInterval of the last time that it was true, unless hurry() was called since.
  [[nodiscard]] bool isDue();
  void hurry() { next_ = Clock::time_point::min(); }

  /// Whether edits can be kept. True: the answer is another than the last time, and has been logged.
  [[nodiscard]] bool checkState();
  /// Looks for renderers that ended. True: some are missing, and it is time to replace them: after each failure the
  /// next attempt waits twice as long, up to half a minute.
  [[nodiscard]] bool wantsRenderers(solver::Transport& transport);
  /// Blocks as Transport::replaceMissing() does; a failure is logged.
  void replaceRenderers(solver::Transport& transport);
  /// As wantsRenderers() found them, or replaceRenderers() left them.
  [[nodiscard]] const solver::Transport::Renderers& renderers() const { return renderers_; }

  /// What was found, for a status whose state is that of now.
  void addTo(Status& status) const;

 private:
  std::shared_ptr<const state::Store> store_;
  Clock::time_point next_ = Clock::time_point::min();
  std::string state_trouble_;
  solver::Transport::Renderers renderers_;
  Clock::time_point next_replacement_ = Clock::time_point::min();
  Clock::duration replacement_wait_ = kInterval;
};

}  // namespace radiosity::engine
