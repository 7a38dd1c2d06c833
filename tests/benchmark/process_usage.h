// What another process has used so far, from /proc. Plain values.
#pragma once

#include <sys/types.h>

#include <cstdint>

namespace radiosity::benchmark {

struct ProcessUsage {
  double solve_seconds = 0.0;  ///< processor time of all threads but those of the network, and of worker processes
  double net_seconds = 0.0;    ///< processor time of the network's threads: the first one, and those called "net"
  std::uint64_t resident_bytes = 0;  ///< of the process itself
};

/// Throws std::runtime_error when the process is not there.
[[nodiscard]] ProcessUsage usageOf(pid_t process);

}  // namespace radiosity::benchmark
