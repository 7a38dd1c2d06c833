#include "server/engine/loop/command_queue.h"

#include <utility>

namespace radiosity::engine {

bool CommandQueue::push(Command command, Kind kind) {
  {
    const std::scoped_lock lock(mutex_);
    if (closed_ || prompt_.size() + long_.size() >= capacity_) return false;
    if (kind == Kind::kPrompt) {
      prompt_.push_back(std::move(command));
    } else {
      long_.push_back({std::move(command), Clock::now()});
    }
  }
  wake_.notify_one();
  return true;
}

std::optional<std::vector<CommandQueue::Command>> CommandQueue::take(bool wait,
                                                                     std::optional<std::chrono::nanoseconds> longest) {
  std::unique_lock lock(mutex_);
  const auto has_some = [this] { return closed_ || woken_ || !prompt_.empty() || !long_.empty(); };
  if (wait && longest) {
    (void)wake_.wait_for(lock, *longest, has_some);
  } else if (wait) {
    wake_.wait(lock, has_some);
  }
  if (closed_) return std::nullopt;
  was_woken_ = std::exchange(woken_, false);
  const bool is_overdue = gave_prompt_ && !long_.empty() && Clock::now() - long_.front().since >= patience_;
  gave_prompt_ = !prompt_.empty() && !is_overdue;
  if (gave_prompt_ || long_.empty()) return std::exchange(prompt_, {});
  std::vector<Command> one;
  one.push_back(std::move(long_.front().command));
  long_.pop_front();
  return one;
}

void CommandQueue::wake() {
  {
    const std::scoped_lock lock(mutex_);
    woken_ = true;
  }
  wake_.notify_one();
}

bool CommandQueue::closed() const {
  const std::scoped_lock lock(mutex_);
  return closed_;
}

bool CommandQueue::isPressing() const {
  const std::scoped_lock lock(mutex_);
  return closed_ || !prompt_.empty();
}

void CommandQueue::close() {
  {
    const std::scoped_lock lock(mutex_);
    closed_ = true;
  }
  wake_.notify_all();
}

}  // namespace radiosity::engine
