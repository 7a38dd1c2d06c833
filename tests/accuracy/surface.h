// The error that people see: points spread evenly over all that there is, looked up in the lit file as an engine does,
// against the path tracer's irradiance there. Nothing is left out whose share is not counted. Pure functions.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "tests/accuracy/lit_scene.h"
#include "tests/oracle/error_metrics.h"
#include "tests/oracle/path_tracer.h"
#include "tests/oracle/shading.h"

namespace radiosity::accuracy {

/// On one side of a surface.
struct SurfacePoint {
  glm::dvec3 position{0.0};
  glm::dvec3 normal{0.0};  ///< unit, of the side that is seen; of the triangle, not of its shading
  /// Of what transmits diffusely: what a surface of its base colour alone would need to look the same, as lightmaps
  /// hold it.
  oracle::Irradiance irradiance;

  /// Nobody sees it: it lies inside a solid, whose backs end nearly all rays at once.
  [[nodiscard]] bool buried() const { return irradiance.back_fraction >= 0.95; }
  /// Its surface is transparent there: nothing is seen.
  [[nodiscard]] bool cutOut() const { return !(irradiance.visible_fraction > 0.0); }
};

/// By area over every triangle, on both sides of double-sided ones by turns, with `samples` paths each.
[[nodiscard]] std::vector<SurfacePoint> makePoints(const oracle::TriangleScene& scene, std::size_t count,
                                                   std::uint32_t samples, std::uint64_t seed);

/// What arrives at its other side.
[[nodiscard]] oracle::Footprint turnedOver(oracle::Footprint footprint);
/// As lightmaps show a translucent triangle around `position`: from its own light, and that of its other side.
[[nodiscard]] oracle::Irradiance shownThrough(const oracle::Shading& shading, const oracle::Triangle& triangle,
                                              const glm::dvec3& position, const oracle::Irradiance& own,
                                              const oracle::Irradiance& beyond);

/// Of the mean of red, green and blue. Figures are of points where there is light; those that are dark in truth, below
/// a hundredth of the mean, are counted, and so are the leaks among them: lit in the file by more than a twentieth of
/// it.
struct SurfaceError {
  double rms_with_noise = 0.0;                ///< over the mean of the truth
  double reference_noise = 0.0;               ///< of it, by the reference's own standard errors
  double median = 0.0, p95 = 0.0, p99 = 0.0;  ///< of |difference| / truth, noise included
  double mean_ratio = 0.0;                    ///< of the means, file over truth
  std::size_t points = 0;                     ///< all that were drawn: the sum of the rest
  std::size_t compared = 0, dark = 0, buried = 0, cut_out = 0;
  std::size_t missed = 0;      ///< the file draws nothing there, or has no texels
  std::size_t missed_lit = 0;  ///< of these: not dark
  std::size_t not_finite = 0;  ///< it has no number there
  std::size_t leaks = 0;       ///< of the dark ones
  /// Of the leaks: rays from there leave the scene, so that it can be seen. Others may lie inside double-sided solids.
  std::size_t open_leaks = 0;

  [[nodiscard]] double rms() const;                     ///< without the noise: independent errors add in squares
  [[nodiscard]] double share(std::size_t count) const;  ///< of the area
};

struct SurfaceComparison {
  SurfaceError error;
  /// All points that are seen and found, dark ones too, as the program states its error: over the RMS of the light.
  oracle::ErrorMetrics total;
};
[[nodiscard]] SurfaceComparison compareSurface(const LitScene& lit, std::span<const SurfacePoint> points);

[[nodiscard]] nlohmann::json toJson(const SurfaceError& error);

/// What of the area the figures are not of, in words; empty where it is nothing.
[[nodiscard]] std::string leftOutText(const SurfaceError& error);

}  // namespace radiosity::accuracy
