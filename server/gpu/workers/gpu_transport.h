// Ways to get a Transport that renders hemicubes with OpenGL.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "common/result.h"
#include "server/gpu/gl/drawing.h"
#include "server/gpu/run/sight.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

/// One EGL context in the calling thread, which must also be the thread that uses and destroys it.
/// kUnavailable, naming every platform tried and why it failed, when there is no OpenGL 4.5 core. `hands`: threads that
/// look at images (see ShotCrew); 0: as many as suit the context. `drawing`: as suits it, but for tests.
[[nodiscard]] Result<std::unique_ptr<solver::Transport>> makeInProcessTransport(
    std::size_t hands = 0, std::optional<Drawing> drawing = std::nullopt, Sight sight = Sight::kAuto);

/// How many hands each of so many contexts shall have: with a card, one a core together, up to 32 each; one where
/// processors draw.
[[nodiscard]] std::size_t handsFor(bool software, std::size_t contexts);

struct WorkerOptions {
  int workers = 0;         ///< 0: one for each core with llvmpipe, one on a GPU
  std::string executable;  ///< started as `executable --worker ...`; normally /proc/self/exe
  /// A worker that owes an answer for longer than this, and 2 us for each pixel it has to draw (50 times what llvmpipe
  /// takes), counts as hung, unless it was hardly let run. Long, because to be wrong costs its work twice.
  std::chrono::milliseconds patience{30'000};
  Sight sight = Sight::kAuto;
  std::size_t hands = 0;  ///< of each worker (ShotCrew); 0: as many as suit the driver
  /// On which Sight is tried; none: it is not.
  std::function<Result<std::shared_ptr<const scene::PatchScene>>()> make_trial_room = {};
};

/// Worker processes, each with its own EGL display, results in shared memory. A worker that dies or hangs is replaced
/// and its part of the batch done again.
[[nodiscard]] Result<std::unique_ptr<solver::Transport>> makeWorkerTransport(const WorkerOptions& options);

/// The body of a worker process; returns its exit status. argv as received by main after `--worker`.
int workerMain(int argc, char** argv);

}  // namespace radiosity::gpu
