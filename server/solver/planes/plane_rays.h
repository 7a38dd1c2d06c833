// Illuminance at the points of a measuring plane, in rounds of independent estimates. Owned by whoever measures; one
// thread outside of the calls.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/solver/surface/place_light.h"

namespace radiosity::solver {

/// Points at the centres of columns x rows cells, row by row; unit box.
struct PlaneGrid {
  glm::dvec3 corner{0.0}, across{0.0}, down{0.0};  ///< both sides
  glm::dvec3 normal{0.0};                          ///< unit length
  std::uint32_t columns = 1, rows = 1;

  [[nodiscard]] std::size_t pointCount() const { return std::size_t{columns} * rows; }
  [[nodiscard]] glm::dvec3 pointAt(std::size_t point) const;
};

/// Photometric: the channels weighted by Rec. 709.
[[nodiscard]] double luminous(const glm::dvec3& light);

/// Of one point, over all rounds: sums by even and odd rounds.
struct PointSums {
  std::array<double, 2> light{}, squares{};  ///< lux, and squares of it
  double reflected = 0.0;                    ///< the part of `light` that is not straight from lamps
  double off = 0.0, off_squares = 0.0;       ///< PlaceLight::Arriving::off
};

class PlaneRays {
 public:
  /// Of a point and round.
  static constexpr std::uint32_t kRays = 32;
  /// Always even, so that both halves have as many. The fewest where more would be beyond kMostRays.
  static constexpr std::uint32_t kFewestRounds = 8, kLeastRounds = 16, kMostRounds = 512;

  /// `light` is to outlive it; `key`: the same gives the same bits, whatever the number of threads.
  PlaneRays(const PlaceLight& light, const PlaneGrid& grid, std::uint64_t key);

  /// Two more rounds, on all cores. Cost: 2 kRays rays a point, and what lamps take that are seen in part. Throws what
  /// interrupts the task (task.h), and is of no use then.
  void addRounds();
  /// addRounds(), kLeastRounds and then until the standard error that rays leave, as RMS over the points, is at most
  /// such a part of the mean; kMostRounds, or as many as kMostRays allow, at most.
  void measure(double wanted);

  [[nodiscard]] std::uint32_t rounds() const { return static_cast<std::uint32_t>(means_.size()); }
  [[nodiscard]] const std::vector<PointSums>& points() const { return points_; }
  [[nodiscard]] const PlaneGrid& grid() const { return grid_; }
  /// Over the points, by round.
  [[nodiscard]] const std::vector<double>& means() const { return means_; }

 private:
  /// In all, those towards lamps included, beyond those of the fewest rounds.
  static constexpr std::uint64_t kMostRays = std::uint64_t{1} << 25;

  void addRound();
  [[nodiscard]] bool isSure(double wanted) const;

  const PlaceLight& light_;
  PlaneGrid grid_;
  std::uint64_t key_;
  std::vector<PointSums> points_;
  std::vector<double> means_;
};

/// Variance of the mean over `rounds` values of which these are the sums.
[[nodiscard]] double varianceOfMean(double sum, double squares, double rounds);

}  // namespace radiosity::solver
