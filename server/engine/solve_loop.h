// The engine: one thread that owns the scene, the solver, the transport and the view renderer. Edits and questions
// enter a bounded queue; lightmaps and status leave as immutable values. Nobody outside ever waits for a shot to finish
// unless he asks a question, and the solver never waits for a client.
#pragma once

#include <chrono>
#include <functional>
#include <memory>
#include <string>

#include "common/result.h"
#include "server/engine/engine.h"
#include "server/solver/transport.h"

namespace radiosity::engine {

struct EngineOptions {
  SolveSettings settings;
  /// Makes the transport, on the solve thread. kUnavailable (no EGL driver) ends start-up.
  std::function<Result<std::unique_ptr<solver::Transport>>()> make_transport;
  /// After a transport failed, before the solve starts over on it; doubled for each failure of the same solve, of which
  /// the fifth ends it. Drivers take seconds to reset a card.
  std::chrono::milliseconds recovery_wait{500};
};

/// Starts the solve thread and the transport; returns when both are up, or why not.
[[nodiscard]] Result<std::unique_ptr<Engine>> makeEngine(EngineOptions options);

}  // namespace radiosity::engine
