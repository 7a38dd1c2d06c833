// Where threads that have no OpenGL context have their images drawn: they ask, and the one thread that owns the context
// draws for one after the other. A context that moved from thread to thread would cost a flush of the driver each time.
#pragma once

#include <condition_variable>
#include <deque>
#include <functional>
#include <mutex>

namespace radiosity::gpu {

class RenderDesk {
 public:
  /// Has `work` done by the thread in serve(), and waits until it is; what it throws is thrown here. Any thread but
  /// that.
  void ask(const std::function<void()>& work);
  /// To be called once by each of those that serve() waits for, after its last ask().
  void leave();
  /// Works for others until so many have left.
  void serve(std::size_t askers);

 private:
  struct Order;

  std::mutex mutex_;
  std::condition_variable ordered_;
  std::deque<Order*> orders_;
  std::size_t left_ = 0;
};

}  // namespace radiosity::gpu
