// Measuring planes as messages and files tell them. Plain values; used by the server, the client and the codec.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace radiosity::protocol {

inline constexpr std::size_t kMaxPlanes = 64;
inline constexpr std::size_t kMaxPlanePoints = 250'000;     ///< of all planes together
inline constexpr std::size_t kMaxInlinePlanePoints = 4096;  ///< with more a message has no grids, only files do

/// Lux, or percent for daylight factors. Errors are standard errors.
struct PlaneFigures {
  double mean = 0.0, mean_error = 0.0;
  double minimum = 0.0, minimum_error = 0.0, maximum = 0.0, maximum_error = 0.0;
  double median = 0.0;
  double uniformity = 0.0, uniformity_error = 0.0;
  double solve_error = 0.0;
  std::vector<double> light, error;  ///< by point, row by row; empty: left out
};

/// "passes", "fails", "undecided"; empty: nothing is asked for.
struct PlaneVerdicts {
  std::string lux, uniformity, all;
};

struct Plane {
  std::uint64_t node = 0;
  std::string name;
  std::uint64_t columns = 1, rows = 1;
  std::array<double, 3> first{}, across{}, down{}, normal{};  ///< metres: first point, steps to the next column and row
  std::optional<double> wanted_lux, wanted_uniformity;
  PlaneVerdicts verdict;
  PlaneFigures illuminance;
  std::optional<PlaneFigures> daylight_factor;

  [[nodiscard]] std::array<double, 3> pointAt(std::size_t point) const;
};

struct Planes {
  std::uint64_t revision = 0;
  std::string state;
  double error = 1.0;  ///< total, as Progress tells it
  std::vector<Plane> planes;
};

/// Two tables with an empty line between: one line a plane, then one line a point. RFC 4180, lines end with CR LF; a
/// name that a spreadsheet would take for a formula begins with an apostrophe.
[[nodiscard]] std::string planesCsv(const Planes& planes);

}  // namespace radiosity::protocol
