// What other threads ask of the solve thread: commands in the order they came, never more than a fixed number. What may
// take seconds (pictures, files) waits for all else, and comes out by itself: an edit is not to wait for them. But not
// for ever: whoever asks over and over, a light meter say, is not to keep others from getting the scene. push() and
// close() from any thread, take() from the solve thread alone.
#pragma once

#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <functional>
#include <mutex>
#include <optional>
#include <vector>

namespace radiosity::engine {

class CommandQueue {
 public:
  using Command = std::function<void()>;

  /// `patience`: so long the oldest long command lets prompt ones go before it.
  explicit CommandQueue(std::size_t capacity, std::chrono::nanoseconds patience = std::chrono::seconds(1))
      : capacity_(capacity), patience_(patience) {}

  /// False: the queue is full or closed, and the command will never run.
  enum class Kind { kPrompt, kLong };
  [[nodiscard]] bool push(Command command, Kind kind = Kind::kPrompt);
  /// take() returns, with nothing more than it would have had. Nobody waits for it: it is not pressing.
  void wake();

  /// All prompt ones that are due, oldest first; where there are none, or the last call gave some and the oldest long
  /// one has waited long enough, that. `wait`: sleeps until there is something, or for `longest`. Nothing: the queue
  /// was closed.
  [[nodiscard]] std::optional<std::vector<Command>> take(bool wait,
                                                         std::optional<std::chrono::nanoseconds> longest = {});

  /// Whether wake() was called before the last take(), which may have had nothing to give. The solve thread.
  [[nodiscard]] bool wasWoken() const { return was_woken_; }

  [[nodiscard]] bool closed() const;
  /// Whether take() has prompt commands to give, or the end to tell of. Any thread.
  [[nodiscard]] bool isPressing() const;

  /// Wakes the solve thread for the last time. Commands that still wait are dropped unanswered.
  void close();

 private:
  using Clock = std::chrono::steady_clock;
  struct Waiting {
    Command command;
    Clock::time_point since;
  };

  const std::size_t capacity_;
  const std::chrono::nanoseconds patience_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<Command> prompt_;
  std::deque<Waiting> long_;
  bool gave_prompt_ = false, woken_ = false, closed_ = false;
  bool was_woken_ = false;  ///< of the solve thread
};

}  // namespace radiosity::engine
