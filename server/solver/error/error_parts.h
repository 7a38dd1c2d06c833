// What a solver says of its own error, and where the energy went. Plain values.
#pragma once

#include <array>

namespace radiosity::solver {

/// Relative RMS errors of irradiance: sqrt(sum a |dH|^2 / sum a |H|^2) over leaves and channels, a = visible area.
struct ErrorParts {
  double total = 1.0;           ///< residual, sampling and variation together
  double residual = 1.0;        ///< light not yet shot, spread evenly, and light that varies inside shooters
  double sampling = 0.0;        ///< half the difference of the two independent halves
  double variation = 0.0;       ///< light that varies within leaves, of which others see a part: finer ones lower it
  double discretization = 0.0;  ///< leaf against the bilinear interpolation of its parents, a third (second order)
};

/// Flux per channel, lux unit^2. emitted = absorbed + specular + escaped + backface + unshot + imbalance. `specular`:
/// what arrives at mirrors and metal, less what rays find in them; with glass, of which no leaf knows what it stops,
/// all that is not found elsewhere. Of all others it is `absorbed`. `unshot` can be below zero by chance: winners at
/// roulette stand for more, or less, than there is.
struct EnergyParts {
  std::array<double, 3> emitted{}, absorbed{}, specular{}, escaped{}, backface{}, unshot{};
  /// What unbiased sampling created or destroyed by chance (gathered light): zero in the mean.
  std::array<double, 3> imbalance{};
};

}  // namespace radiosity::solver
