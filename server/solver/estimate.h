// What the solver can say about its own error, and where the energy went. Pure functions of the state.
#pragma once

#include <array>
#include <vector>

#include "server/solver/state.h"

namespace radiosity::solver {

/// Relative RMS errors of irradiance: sqrt(sum a |dH|^2 / sum a |H|^2) over leaves and channels, a = visible area.
struct ErrorParts {
  double total = 1.0;     ///< residual and sampling together: what further shots will remove
  double residual = 1.0;  ///< light not yet shot, spread evenly, with all its further bounces
  double sampling = 0.0;  ///< half the difference of the two independent halves
  double discretization =
      0.0;  ///< leaf against the bilinear interpolation of its parents, a third of it (second order)
};

/// Flux per channel, lux unit^2, as a mean over rounds.
/// emitted = absorbed + escaped + backface + unshot + imbalance.
struct EnergyParts {
  std::array<double, 3> emitted{}, absorbed{}, escaped{}, backface{}, unshot{};
  /// What unbiased sampling created or destroyed by chance (gathered light, roulette): zero in the mean.
  std::array<double, 3> imbalance{};
};

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
