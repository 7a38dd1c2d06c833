// Starts worker processes (worker_process.h). Any thread; waits.
#pragma once

#include <chrono>
#include <cstddef>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/gpu/workers/worker_process.h"

namespace radiosity::gpu {

/// A cold driver compiles its shaders, perhaps on a busy machine.
inline constexpr auto kStartPatience = std::chrono::seconds(60);

/// `count` of them, all at the same time. `one_of_card`: only one where a card draws, since one context keeps it busy,
/// and several take turns and a second each to start. Then, where there may be a card, the others wait until the first
/// one tells what draws.
[[nodiscard]] Result<std::vector<WorkerProcess>> startWorkers(const std::string& executable, std::size_t count,
                                                              bool one_of_card);

}  // namespace radiosity::gpu
