// Who hears of progress and lightmaps. Held by weak pointers, so that a session that ends needs no farewell. add() from
// any thread; the solve thread tells.
#pragma once

#include <memory>
#include <mutex>
#include <utility>
#include <vector>

#include "server/engine/engine.h"

namespace radiosity::engine {

class Listeners {
 public:
  void add(std::weak_ptr<Listener> listener) {
    const std::scoped_lock lock(mutex_);
    std::erase_if(listeners_, [](const auto& gone) { return gone.expired(); });
    listeners_.push_back(std::move(listener));
  }

  /// Calls `call(Listener&)` for each, without holding the lock: a listener may add another.
  template <typename Call>
  void tell(const Call& call) const {
    std::vector<std::shared_ptr<Listener>> alive;
    {
      const std::scoped_lock lock(mutex_);
      for (const auto& listener : listeners_) {
        if (auto strong = listener.lock()) alive.push_back(std::move(strong));
      }
    }
    for (const auto& listener : alive) call(*listener);
  }

 private:
  mutable std::mutex mutex_;
  std::vector<std::weak_ptr<Listener>> listeners_;
};

}  // namespace radiosity::engine
