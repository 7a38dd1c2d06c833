// Pictures and files: what takes seconds to make of a scene. One thread makes them, one at a time, so that neither
// edits nor the solve wait for them; sessions come in turn (fair_queue.h), and what nobody waits for any more ends
// within the next interruption point. push() and callOff(): any thread.
#pragma once

#include <condition_variable>
#include <cstddef>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <stop_token>
#include <thread>

#include "common/result.h"
#include "common/task.h"
#include "server/engine/engine.h"
#include "server/engine/loop/fair_queue.h"

namespace radiosity::engine {

class LongWork {
 public:
  /// `at_end` is the last that the thread does: what its work has kept there is let go.
  LongWork(std::size_t capacity, std::function<void()> at_end);
  ~LongWork();  ///< calls all off and waits for the thread
  LongWork(const LongWork&) = delete;
  LongWork& operator=(const LongWork&) = delete;

  /// `run` answers by itself, or throws Interrupted where its task is called off, or std::bad_alloc; then, and where
  /// its turn never comes, `refuse` is called once instead, on the thread or in callOff(). False: too many wait.
  [[nodiscard]] bool push(const Client& client, std::function<void()> run, std::function<void(const Error&)> refuse);

  /// What is under way and what waits is refused; push() refuses from now on.
  void callOff();

 private:
  using Cancel = std::function<void()>;
  struct Piece {
    std::shared_ptr<Task> task;
    std::function<void()> run;
    std::function<void(const Error&)> refuse;
    std::shared_ptr<std::stop_callback<Cancel>> when_gone;
  };

  void threadMain(const std::function<void()>& at_end);
  [[nodiscard]] std::optional<Piece> next();
  [[nodiscard]] static Error whyCancelled();

  const std::size_t capacity_;
  std::mutex mutex_;
  std::condition_variable wake_;
  FairQueue<Piece> waiting_;
  std::shared_ptr<Task> present_;  ///< null: the thread waits
  bool called_off_ = false, closed_ = false;
  std::thread thread_;
};

}  // namespace radiosity::engine
