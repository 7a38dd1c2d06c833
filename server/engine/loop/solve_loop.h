// The engine: one thread that owns the scene, the solver, the transport and the view renderer. Edits and questions
// enter a bounded queue; lightmaps and status leave as immutable values. Nobody outside ever waits for a shot to finish
// unless he asks a question, and the solver never waits for a client.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <memory>
#include <set>
#include <string>

#include "common/result.h"
#include "server/engine/engine.h"
#include "server/solver/transport/transport.h"
#include "server/state/store.h"

namespace radiosity::engine {

struct EngineOptions {
  SolveSettings settings;
  /// Makes the transport, on the solve thread. kUnavailable (no EGL driver) ends start-up.
  std::function<Result<std::unique_ptr<solver::Transport>>()> make_transport;
  /// After a transport failed, before the solve starts over on it; doubled for each failure of the same solve, of which
  /// the fifth ends it. Drivers take seconds to reset a card.
  std::chrono::milliseconds recovery_wait{500};

  /// After an edit of geometry that took no longer than this to make its light is waited for as long, before the light
  /// that there was is shown where things lie now.
  std::chrono::milliseconds solved_soon{30};

  /// Scenes of more texels than this are lit at `first_texels` first, while the others are being made; 0: none are.
  std::uint64_t first_light_above = 1'000'000;
  std::uint64_t first_texels = 100'000;

  /// What a scene may claim (scene::ImportLimits); 0: a quarter of the memory there is. Of scenes that clients load, of
  /// edits, and of the kept scene.
  std::uint64_t max_scene_bytes = 0;

  /// What outlives this process; null: nothing does. An edit is answered only when it is in there.
  std::shared_ptr<state::Store> store;
  std::set<std::string> named_settings;  ///< of `settings`, by their names in the store: these go before kept ones
  std::size_t checkpoint_bytes = std::size_t{256} << 20;  ///< of one checkpoint; a solve that needs more has none
  std::chrono::milliseconds checkpoint_interval{5'000};   ///< at least; and at its end
};

/// Starts the solve thread and the transport, and brings back what the store holds; returns when all are up, or why
/// not.
[[nodiscard]] Result<std::unique_ptr<Engine>> makeEngine(EngineOptions options);

}  // namespace radiosity::engine
