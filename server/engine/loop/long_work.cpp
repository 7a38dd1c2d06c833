#include "server/engine/loop/long_work.h"

#include <pthread.h>

#include <new>
#include <utility>
#include <vector>

#include "common/log.h"
#include "server/engine/lit/memory.h"

namespace radiosity::engine {

LongWork::LongWork(std::size_t capacity, std::function<void()> at_end) : capacity_(capacity) {
  thread_ = std::thread([this, at_end = std::move(at_end)] { threadMain(at_end); });
  (void)pthread_setname_np(thread_.native_handle(), "pictures");
}

LongWork::~LongWork() {
  callOff();
  {
    const std::scoped_lock lock(mutex_);
    closed_ = true;
  }
  wake_.notify_all();
  thread_.join();
}

Error LongWork::whyCancelled() { return cancelled("nobody waits for it any more, or the server is shutting down"); }

bool LongWork::push(const Client& client, std::function<void()> run, std::function<void(const Error&)> refuse) {
  Piece piece{std::make_shared<Task>(), std::move(run), std::move(refuse), nullptr};
  if (client.gone.stop_possible())
    piece.when_gone =
        std::make_shared<std::stop_callback<Cancel>>(client.gone, [task = piece.task] { task->cancel(); });
  bool is_late = false;
  std::vector<Piece> forsaken;  // refused without the lock: who is told may ask for more
  {
    const std::scoped_lock lock(mutex_);
    if (waiting_.size() >= capacity_)
      forsaken = waiting_.takeIf([](const Piece& waiting) { return waiting.task->isCancelled(); });
    if (waiting_.size() >= capacity_) return false;
    is_late = called_off_;
    if (!is_late) waiting_.push(client.session, std::move(piece));
  }
  if (is_late) piece.refuse(whyCancelled());
  for (const auto& late : forsaken) late.refuse(whyCancelled());
  wake_.notify_one();
  return true;
}

void LongWork::callOff() {
  std::vector<Piece> refused;
  {
    const std::scoped_lock lock(mutex_);
    called_off_ = true;
    if (present_) present_->cancel();
    while (auto piece = waiting_.pop()) refused.push_back(std::move(*piece));
  }
  for (const auto& piece : refused) piece.refuse(whyCancelled());
}

/// Nothing: the end.
std::optional<LongWork::Piece> LongWork::next() {
  std::unique_lock lock(mutex_);
  present_.reset();
  wake_.wait(lock, [this] { return closed_ || waiting_.size() > 0; });
  auto piece = waiting_.pop();
  if (piece) present_ = piece->task;
  return piece;
}

void LongWork::threadMain(const std::function<void()>& at_end) {
  while (const auto piece = next()) {
    const TaskScope scope(piece->task.get());
    try {
      interruptionPoint();
      piece->run();
    } catch (const Interrupted&) {
      piece->refuse(whyCancelled());
    } catch (const std::bad_alloc&) {
      piece->refuse(outOfMemory().value());
    }
  }
  at_end();
}

}  // namespace radiosity::engine
