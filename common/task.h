// Work that can be called off while it is done: a load, a picture, a file. A thread that does such work has a current
// task, which doShares() hands on to the threads that help it, so that the functions in between need no parameter for
// it (the interruption points of Boost.Thread are the model). Work without a task, an edit say, is never called off.
#pragma once

#include <atomic>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <functional>
#include <utility>

namespace radiosity {

/// Thrown by interruptionPoint() alone; whoever made the thread's TaskScope catches it.
class Interrupted : public std::exception {
 public:
  [[nodiscard]] const char* what() const noexcept override { return "the work was called off"; }
};

/// One piece of work, as those see it who wait for it or call it off. Any thread.
class Task {
 public:
  Task() = default;
  /// `told` is called whenever there is more progress than anyone has seen, at most ten times a second, by whichever
  /// thread is at work.
  explicit Task(std::function<void()> told) : told_(std::move(told)) {}
  /// Called off from elsewhere, another process maybe, as soon as `mark` is `number` or more.
  Task(const std::atomic<std::uint64_t>& mark, std::uint64_t number) : mark_(&mark), number_(number) {}
  Task(const Task&) = delete;
  Task& operator=(const Task&) = delete;
  ~Task() = default;

  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  [[nodiscard]] bool isCancelled() const {
    return cancelled_.load(std::memory_order_relaxed) ||
           (mark_ != nullptr && mark_->load(std::memory_order_relaxed) >= number_);
  }
  /// How much of the work is done, in [0, 1]; never falls.
  [[nodiscard]] double fraction() const { return fraction_.load(std::memory_order_relaxed); }

  /// What follows is the part of the work from where the last stage ended to `end`, in [0, 1].
  void beginStage(double end);
  /// How much of the present stage is done, in [0, 1].
  void tellProgress(double of_stage);

 private:
  using Clock = std::chrono::steady_clock;

  std::atomic<bool> cancelled_{false};
  std::atomic<double> stage_begin_{0.0}, stage_end_{0.0}, fraction_{0.0};
  std::atomic<Clock::rep> next_told_{0};
  std::function<void()> told_;
  const std::atomic<std::uint64_t>* mark_ = nullptr;
  std::uint64_t number_ = 0;
};

namespace detail {
inline constinit thread_local Task* current_task = nullptr;
}  // namespace detail

/// The task of this thread; null: none.
[[nodiscard]] inline Task* currentTask() { return detail::current_task; }

/// Makes `task`, which may be null, the current one of this thread for as long as the scope lives.
class TaskScope {
 public:
  explicit TaskScope(Task* task) : before_(std::exchange(detail::current_task, task)) {}
  ~TaskScope() { detail::current_task = before_; }
  TaskScope(const TaskScope&) = delete;
  TaskScope& operator=(const TaskScope&) = delete;

 private:
  Task* before_;
};

/// Throws Interrupted where the current task was called off. A nanosecond; work that may be called off passes one every
/// few milliseconds.
inline void interruptionPoint() {
  if (const auto* task = detail::current_task; task != nullptr && task->isCancelled()) throw Interrupted();
}

/// The same with a part of the present stage that is done: step `done` of `steps`.
inline void interruptionPoint(std::size_t done, std::size_t steps) {
  interruptionPoint();
  auto* task = detail::current_task;
  if (task != nullptr && steps > 0) task->tellProgress(static_cast<double>(done) / static_cast<double>(steps));
}

/// A comparison for sorting so much that it may have to be called off: each one is an interruption point.
template <typename Less>
[[nodiscard]] auto interruptible(Less less) {
  return [less = std::move(less)](const auto& a, const auto& b) {
    interruptionPoint();
    return less(a, b);
  };
}

/// Task::beginStage() of the current task, if there is one, and an interruption point.
inline void beginStage(double end) {
  interruptionPoint();
  if (auto* task = detail::current_task; task != nullptr) task->beginStage(end);
}

}  // namespace radiosity
