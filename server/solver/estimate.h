// What the solver can say about its own error, and where the energy went. Pure functions of the state.
#pragma once

#include <array>
#include <vector>

#include "server/solver/error_parts.h"
#include "server/solver/state.h"

namespace radiosity::solver {

/// Needs pushPullAll(). `owed`: flux that light polygons have yet to deliver, all channels, over all rounds.
[[nodiscard]] ErrorParts estimateError(const RadiosityState& state, double owed);
[[nodiscard]] EnergyParts energyBalance(const RadiosityState& state, const std::array<double, 3>& shot,
                                        const std::array<double, 3>& gather_emitted);

/// Mean reflectance weighted by received flux, at most 0.999: each unit of unshot flux becomes 1 / (1 - this) in all.
[[nodiscard]] double meanReflectance(const RadiosityState& state);

/// Flux received so far over all rounds, all channels, lux unit^2.
[[nodiscard]] double receivedFlux(const RadiosityState& state);

}  // namespace radiosity::solver
