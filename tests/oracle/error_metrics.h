// How far values are from a reference, as one set of figures. Pure function.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <span>

namespace radiosity::oracle {

struct ErrorMetrics {
  double relative_rms = 0.0;  ///< sqrt(sum a |H - Href|^2 / sum a |Href|^2), over RGB
  double mean = 0.0;          ///< of the relative error of luminance, area-weighted; not of what is nearly black
  double median = 0.0;
  double p99 = 0.0;
  double bias = 0.0;             ///< sum a Y / sum a Yref - 1
  double reference_noise = 0.0;  ///< relative RMS standard error of the reference: part of relative_rms
  /// Standard error of solverRms()^2, by how much what was compared differs: a reference's noise is known to one part
  /// in the root of their number, which small errors are lost in.
  double square_uncertainty = 0.0;
  std::size_t count = 0;

  /// relative_rms without the reference's own noise (independent errors add in squares).
  [[nodiscard]] double solverRms() const;
  /// It lies between these, two times in three.
  [[nodiscard]] std::array<double, 2> solverRange() const;
};

struct Comparison {
  glm::dvec3 value{0.0}, reference{0.0}, standard_error{0.0};
  double weight = 0.0;  ///< visible area; 0: left out
};

[[nodiscard]] ErrorMetrics measureError(std::span<const Comparison> comparisons);

/// Luminance of linear sRGB (Rec. 709 weights).
[[nodiscard]] double luminance(const glm::dvec3& rgb);

}  // namespace radiosity::oracle
