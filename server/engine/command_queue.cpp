#include "server/engine/command_queue.h"

#include <utility>

namespace radiosity::engine {

bool CommandQueue::push(Command command) {
  {
    const std::scoped_lock lock(mutex_);
    if (closed_ || commands_.size() >= capacity_) return false;
    commands_.push_back(std::move(command));
  }
  wake_.notify_one();
  return true;
}

std::optional<std::vector<CommandQueue::Command>> CommandQueue::take(bool wait) {
  std::unique_lock lock(mutex_);
  if (wait) wake_.wait(lock, [this] { return closed_ || !commands_.empty(); });
  if (closed_) return std::nullopt;
  return std::exchange(commands_, {});
}

bool CommandQueue::closed() const {
  const std::scoped_lock lock(mutex_);
  return closed_;
}

void CommandQueue::close() {
  {
    const std::scoped_lock lock(mutex_);
    closed_ = true;
  }
  wake_.notify_all();
}

}  // namespace radiosity::engine
