// What the solver knows, in the units that users see.
#pragma once

#include "server/engine/engine.h"
#include "server/engine/lit/lit_scene.h"

namespace radiosity::engine {

/// Everything of Status that follows from the scene and its solver; state, revision and settings are the caller's.
/// `seconds`: solve time so far, for rates.
[[nodiscard]] Status reportStatus(const LitScene& lit, double seconds);

}  // namespace radiosity::engine
