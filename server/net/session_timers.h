// What a session does after a while. Owned by the session; its strand only.
#pragma once

#include <boost/asio/any_io_executor.hpp>
#include <boost/asio/steady_timer.hpp>
#include <chrono>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>

namespace radiosity::net {

class SessionTimers {
 public:
  using Number = std::uint64_t;

  explicit SessionTimers(boost::asio::any_io_executor executor) : executor_(std::move(executor)) {}

  /// Runs `task` after `delay`, once, unless the timer is cancelled or `owner`, which holds this, is gone.
  Number start(const std::weak_ptr<void>& owner, std::chrono::milliseconds delay, std::function<void()> task);

  /// Also one whose time is up, as long as its task has not begun. Nothing where there is no such timer (any more).
  void cancel(Number number) { timers_.erase(number); }
  void cancelAll() { timers_.clear(); }

 private:
  boost::asio::any_io_executor executor_;
  std::map<Number, boost::asio::steady_timer> timers_;
  Number last_ = 0;
};

}  // namespace radiosity::net
