// Loops over the cores of the machine.
#pragma once

#include <algorithm>
#include <atomic>
#include <cstddef>
#include <cstdint>

#include "common/task.h"

namespace radiosity {

/// What is called for a share of the work. It refers to the callable, which is to outlive it.
class ShareOfWork {
 public:
  template <typename Work>
  explicit ShareOfWork(const Work& work)
      : work_(&work), call_([](const void* of, std::size_t share) { (*static_cast<const Work*>(of))(share); }) {}
  void operator()(std::size_t share) const { call_(work_, share); }

 private:
  const void* work_;
  void (*call_)(const void* work, std::size_t share);
};

/// Calls work(share) once for every share in [0, shares): 0 in this thread, the others in threads that wait for such
/// work, one a core, or in this one where none of them is free. So shares must not wait for each other; they
/// may be divided again. When all have ended, what one of them threw is thrown here. All of them have this thread's
/// task (task.h).
void doShares(std::size_t shares, const ShareOfWork& work);
/// Shares that can be done at the same time, 16 at most.
[[nodiscard]] std::size_t mostShares();

/// Calls work(share, shares) once for every share in [0, shares), of which there are `most`, or as many as can be done
/// at the same time: as doShares().
template <typename Work>
void inShares(std::size_t most, const Work& work) {
  const std::size_t shares = std::clamp<std::size_t>(most, 1, mostShares());
  const auto one = [&](std::size_t share) { work(share, shares); };
  doShares(shares, ShareOfWork(one));
}

/// Calls work(part) once for every part in [0, parts), each by whichever thread of inShares() is free: where some parts
/// take far longer than others, and nobody knows which. At most `most` threads. As doShares(). Every part begins with
/// an interruption point.
template <typename Work>
void inTurns(std::size_t parts, const Work& work, std::size_t most = SIZE_MAX) {
  std::atomic<std::size_t> next{0};
  inShares(std::min(parts, most), [&](std::size_t, std::size_t) {
    for (auto part = next++; part < parts; part = next++) {
      interruptionPoint();
      work(part);
    }
  });
}

}  // namespace radiosity
