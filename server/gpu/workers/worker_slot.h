// A worker of WorkerTransport and what it owes. Plain values; one thread.
#pragma once

#include <chrono>
#include <cstddef>
#include <deque>
#include <optional>
#include <vector>

#include "server/gpu/workers/worker_process.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

/// A process and what it has of the current batch.
struct Slot {
  std::optional<WorkerProcess> process;            ///< none: died, to be replaced
  bool takes_scene = false;                        ///< it was sent one, and has not said that it has it
  std::deque<std::size_t> held;                    ///< chunks sent, not yet reported
  std::vector<std::size_t> done;                   ///< chunks reported, still only in its accumulators
  std::chrono::steady_clock::time_point deadline;  ///< of the chunk it has held longest
  std::chrono::steady_clock::duration patience{};  ///< that the chunk may take
  std::chrono::steady_clock::duration
      used_before{};  ///< processor time of the worker when it started on that chunk, ...
  std::chrono::steady_clock::duration used_lately{};  ///< ... and when it was last given time
  int extensions = 0;                                 ///< how often it was
  solver::TransportCounters counters;
};

}  // namespace radiosity::gpu
