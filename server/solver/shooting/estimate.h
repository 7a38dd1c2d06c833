// What the solver can say about its own error, and where the energy went. Pure functions of the state.
#pragma once

#include <array>
#include <vector>

#include "server/solver/error/error_parts.h"
#include "server/solver/shooting/state.h"

namespace radiosity::solver {

/// Needs pushPullAll(). `owed`: flux that gathered lights have yet to deliver, all channels, over all rounds.
[[nodiscard]] ErrorParts estimateError(const RadiosityState& state, double owed);
/// `shot`: flux the shooters stood for. `gather_emitted`: flux that shots of direct light stood for; both over all
/// rounds. `other_flux`: of lights that are no surfaces.
[[nodiscard]] EnergyParts energyBalance(const RadiosityState& state, const std::array<double, 3>& shot,
                                        const std::array<double, 3>& gather_emitted,
                                        const std::array<double, 3>& other_flux = {});

/// Mean reflectance weighted by received flux, at most 0.999: each unit of unshot flux becomes 1 / (1 - this) in all.
[[nodiscard]] double meanReflectance(const RadiosityState& state);

/// Flux received so far over all rounds, all channels, lux unit^2.
[[nodiscard]] double receivedFlux(const RadiosityState& state);

}  // namespace radiosity::solver
