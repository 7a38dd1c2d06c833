#include "server/gpu/workers/worker_start.h"

#include <filesystem>
#include <utility>

namespace radiosity::gpu {
namespace {

/// Whether there may be a card: where it is not found the first worker tells, and all others were started in vain.
bool mayHaveCard() {
  std::error_code ignored;
  for (const auto* device : {"/dev/dri", "/dev/nvidiactl", "/dev/dxg"}) {
    if (std::filesystem::exists(device, ignored)) return true;
  }
  return false;
}

/// Until there are `count`.
Result<void> addWorkers(const std::string& executable, std::size_t count, std::vector<WorkerProcess>& workers) {
  const auto first = workers.size();
  while (workers.size() < count) {
    auto process = WorkerProcess::start(executable);
    if (!process) return tl::unexpected(process.error());
    workers.push_back(std::move(*process));
  }
  for (auto i = first; i < workers.size(); ++i) {
    const Patience patience{std::chrono::steady_clock::now() + kStartPatience, -1};
    if (auto ready = workers[i].awaitReady(patience); !ready) return tl::unexpected(ready.error());
  }
  return {};
}

}  // namespace

Result<std::vector<WorkerProcess>> startWorkers(const std::string& executable, std::size_t count, bool one_of_card) {
  std::vector<WorkerProcess> workers;
  const bool asks = one_of_card && mayHaveCard();
  if (auto added = addWorkers(executable, asks ? 1 : count, workers); !added) return tl::unexpected(added.error());
  if (one_of_card && !workers.front().software()) {
    workers.erase(workers.begin() + 1, workers.end());
  } else if (auto added = addWorkers(executable, count, workers); !added) {
    return tl::unexpected(added.error());
  }
  return workers;
}

}  // namespace radiosity::gpu
