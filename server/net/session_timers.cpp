#include "server/net/session_timers.h"

#include <utility>

namespace radiosity::net {

SessionTimers::Number SessionTimers::start(const std::weak_ptr<void>& owner, std::chrono::milliseconds delay,
                                           std::function<void()> task) {
  const auto number = ++last_;
  auto& timer = timers_.try_emplace(number, executor_).first->second;
  timer.expires_after(delay);
  timer.async_wait([this, owner, number, task = std::move(task)](boost::system::error_code error) {
    const auto alive = owner.lock();
    // The handler of a timer whose time is up waits its turn as a success, and the timer may be cancelled meanwhile.
    if (error || alive == nullptr || timers_.erase(number) == 0) return;
    task();
  });
  return number;
}

}  // namespace radiosity::net
