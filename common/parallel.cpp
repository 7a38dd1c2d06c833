#include "common/parallel.h"

#include <condition_variable>
#include <deque>
#include <exception>
#include <mutex>
#include <thread>

#include "common/task.h"

namespace radiosity {
namespace {

constexpr std::size_t kMostShares = 16;

/// Shares of one piece of work. All but `work` and `shares` is the helpers', under their lock.
struct Job {
  const ShareOfWork& work;
  std::size_t shares;
  Task* task;                 ///< of the thread whose job it is; null: none
  std::size_t next = 1;       ///< to be taken; 0 is its thread's own
  std::size_t under_way = 0;  ///< by helpers
  std::exception_ptr failed;
};

/// Threads that wait for shares: as many as there are cores, so that two who ask have one each on two cores. Such as
/// are started anew for each share, with a stack and a heap of their own, take a twentieth more time in a small room,
/// for its solve and for its edits; in larger ones nothing.
class Helpers {
 public:
  /// Never destroyed: a thread of the program may still be at work when the process ends.
  static Helpers& all() {
    static auto* helpers = new Helpers;
    return *helpers;
  }

  void carryOut(Job& job) {
    offer(job);
    std::size_t share = 0;
    do {
      attempt(job, share);
    } while (takeOwn(job, share));
    std::unique_lock lock(mutex_);
    done_.wait(lock, [&] { return job.under_way == 0; });
  }

 private:
  void offer(Job& job) {
    const std::scoped_lock lock(mutex_);
    startThreads();
    jobs_.push_back(&job);
    for (auto waiting = std::min(idle_, job.shares - 1); waiting > 0; --waiting) offered_.notify_one();
  }

  void startThreads() {
    try {
      for (; started_ < mostShares(); ++started_) std::thread([this] { serve(); }).detach();
    } catch (const std::exception&) {  // no more threads to be had, or no memory: until there are, those who ask work
    }
  }

  /// The thread whose job it is takes what no helper has taken.
  bool takeOwn(Job& job, std::size_t& share) {
    const std::scoped_lock lock(mutex_);
    if (job.next == job.shares) return false;
    share = take(job);
    return true;
  }

  std::size_t take(Job& job) {
    const auto share = job.next++;
    if (job.next == job.shares) std::erase(jobs_, &job);
    return share;
  }

  void attempt(Job& job, std::size_t share) {
    const TaskScope scope(job.task);
    try {
      interruptionPoint();
      job.work(share);
    } catch (...) {
      const std::scoped_lock lock(mutex_);
      if (!job.failed) job.failed = std::current_exception();
    }
  }

  [[noreturn]] void serve() {
    std::unique_lock lock(mutex_);
    while (true) {
      ++idle_;
      offered_.wait(lock, [&] { return !jobs_.empty(); });
      --idle_;
      auto& job = *jobs_.front();
      const auto share = take(job);
      ++job.under_way;
      lock.unlock();
      attempt(job, share);
      lock.lock();
      if (--job.under_way == 0) done_.notify_all();
    }
  }

  std::mutex mutex_;
  std::condition_variable offered_, done_;
  std::deque<Job*> jobs_;  // of which shares are left
  std::size_t started_ = 0, idle_ = 0;
};

}  // namespace

std::size_t mostShares() {
  static const std::size_t cores =
      std::clamp<std::size_t>(std::thread::hardware_concurrency(), 1, kMostShares);  // which reads a file
  return cores;
}

void doShares(std::size_t shares, const ShareOfWork& work) {
  if (shares == 0) return;
  if (shares == 1) return work(0);
  Job job{work, shares, currentTask(), 1, 0, nullptr};
  Helpers::all().carryOut(job);
  if (job.failed) std::rethrow_exception(job.failed);
}

}  // namespace radiosity
