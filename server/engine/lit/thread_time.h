// Processor time of the calling thread: on a busy machine a piece of work is no more of it than on a quiet one.
#pragma once

#include <chrono>
#include <ctime>

namespace radiosity::engine {

/// Since the thread began.
[[nodiscard]] inline std::chrono::nanoseconds threadTime() {
  timespec now{};
  (void)clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now);
  return std::chrono::seconds(now.tv_sec) + std::chrono::nanoseconds(now.tv_nsec);
}

}  // namespace radiosity::engine
