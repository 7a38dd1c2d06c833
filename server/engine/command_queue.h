// What other threads ask of the solve thread: commands in the order they came, never more than a fixed number. What may
// take seconds (pictures, files) waits for all else, and comes out by itself: an edit is not to wait for them. push()
// and close() from any thread, take() from the solve thread alone.
#pragma once

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

  explicit CommandQueue(std::size_t capacity) : capacity_(capacity) {}

  /// False: the queue is full or closed, and the command will never run.
  enum class Kind { kPrompt, kLong };
  [[nodiscard]] bool push(Command command, Kind kind = Kind::kPrompt);

  /// All prompt ones that are due, oldest first; where there are none, the oldest long one. `wait`: sleeps until there
  /// is something. Nothing: the queue was closed.
  [[nodiscard]] std::optional<std::vector<Command>> take(bool wait);

  [[nodiscard]] bool closed() const;

  /// Wakes the solve thread for the last time. Commands that still wait are dropped unanswered.
  void close();

 private:
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::condition_variable wake_;
  std::vector<Command> prompt_;
  std::deque<Command> long_;
  bool closed_ = false;
};

}  // namespace radiosity::engine
