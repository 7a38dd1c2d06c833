// Who wants which quantity published. add() and the end of what it returns: any thread; the rest: the solve thread.
#pragma once

#include <array>
#include <atomic>
#include <memory>

#include "server/engine/engine.h"

namespace radiosity::engine {

class Watches {
 public:
  /// Counts until it is let go, also where that is after the engine's end.
  [[nodiscard]] std::shared_ptr<void> add(Quantity quantity) {
    auto& count = state_->count[static_cast<std::size_t>(quantity)];
    ++count;
    state_->added[static_cast<std::size_t>(quantity)] = true;
    return {&count, [state = state_, &count](void*) { --count; }};  // not null: it can be asked for
  }

  [[nodiscard]] bool wants(Quantity quantity) const { return state_->count[static_cast<std::size_t>(quantity)] > 0; }
  /// Whether someone who is still there came for it since takeAdded().
  [[nodiscard]] bool hasAdded(Quantity quantity) const {
    return wants(quantity) && state_->added[static_cast<std::size_t>(quantity)];
  }
  /// Whether someone came for it since this was last asked.
  [[nodiscard]] bool takeAdded(Quantity quantity) {
    return state_->added[static_cast<std::size_t>(quantity)].exchange(false);
  }

 private:
  struct State {
    std::array<std::atomic<std::uint64_t>, kQuantityCount> count{};
    std::array<std::atomic<bool>, kQuantityCount> added{};
  };
  std::shared_ptr<State> state_ = std::make_shared<State>();
};

}  // namespace radiosity::engine
