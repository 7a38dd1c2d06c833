#include "server/gpu/draw/render_desk.h"

#include <exception>

namespace radiosity::gpu {

struct RenderDesk::Order {
  const std::function<void()>* work = nullptr;
  bool done = false;
  std::condition_variable served = {};
  std::exception_ptr thrown = {};
};

void RenderDesk::ask(const std::function<void()>& work) {
  Order order;
  order.work = &work;
  std::unique_lock lock(mutex_);
  orders_.push_back(&order);
  ordered_.notify_one();
  order.served.wait(lock, [&] { return order.done; });
  if (order.thrown) std::rethrow_exception(order.thrown);
}

void RenderDesk::leave() {
  const std::lock_guard lock(mutex_);
  ++left_;
  ordered_.notify_one();
}

void RenderDesk::serve(std::size_t askers) {
  std::unique_lock lock(mutex_);
  while (true) {
    ordered_.wait(lock, [&] { return !orders_.empty() || left_ == askers; });
    if (orders_.empty()) break;
    auto& order = *orders_.front();
    orders_.pop_front();
    lock.unlock();
    try {
      (*order.work)();
    } catch (...) {
      order.thrown = std::current_exception();
    }
    lock.lock();
    order.done = true;  // and is gone as soon as the lock is
    order.served.notify_one();
  }
  left_ = 0;
}

}  // namespace radiosity::gpu
