#include "server/engine/lit/disposer.h"

#include <pthread.h>

#include <exception>
#include <utility>

namespace radiosity::engine {

Disposer::~Disposer() {
  {
    const std::scoped_lock lock(mutex_);
    ends_ = true;
  }
  wake_.notify_one();
  if (thread_.joinable()) thread_.join();
}

void Disposer::dispose(std::shared_ptr<const void> of_no_use) noexcept {
  if (!of_no_use) return;
  try {
    if (!thread_.joinable()) {
      thread_ = std::thread([this] { run(); });
      (void)pthread_setname_np(thread_.native_handle(), "dispose");
    }
    const std::scoped_lock lock(mutex_);
    waiting_.push_back(std::move(of_no_use));
  } catch (const std::exception&) {  // of threads or memory there are no more
    return;
  }
  wake_.notify_one();
}

bool Disposer::drain() {
  std::unique_lock lock(mutex_);
  const bool has_some = is_busy_ || !waiting_.empty();
  idle_.wait(lock, [this] { return !is_busy_ && waiting_.empty(); });
  return has_some;
}

void Disposer::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    wake_.wait(lock, [this] { return ends_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    auto some = std::exchange(waiting_, {});
    is_busy_ = true;
    lock.unlock();
    some.clear();
    lock.lock();
    is_busy_ = false;
    if (waiting_.empty()) idle_.notify_all();
  }
}

}  // namespace radiosity::engine
