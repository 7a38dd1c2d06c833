// Directions of a photometric web, drawn in proportion to the light that goes there, so that no beam is too narrow to
// be found. Immutable once made; any thread.
#pragma once

#include <glm/vec2.hpp>
#include <span>
#include <vector>

namespace radiosity::scene {

class WebDirections {
 public:
  /// `table`: LightWeb::table, which must outlive this. O(n), and a float for each of its directions.
  explicit WebDirections(std::span<const float> table);

  /// `weight`: candela there over the density of the draw, as a part of the web's lumens. Its mean over `at` is 1, and
  /// it differs from 1 only as candela and sines do within one cell of the table.
  struct Direction {
    double polar_rad = 0.0, azimuth_rad = 0.0;
    double weight = 0.0;
  };
  /// `at`: uniform in [0, 1)^2. A dark web has weights of 0. O(log n).
  [[nodiscard]] Direction at(const glm::dvec2& at) const;

 private:
  /// Flux between two neighbouring polar angles, per radian of azimuth: where the candela are 1, and where they rise
  /// from 0 to 1.
  struct RingPart {
    double whole, rising;
  };
  [[nodiscard]] static std::vector<RingPart> ringParts(std::span<const float> polar_deg);
  /// Likewise, by row, where the candela are those along one azimuth.
  [[nodiscard]] std::vector<double> rings(std::size_t azimuth, std::span<const RingPart> parts) const;

  std::span<const float> polar_, azimuth_, candela_;  ///< of the table
  std::size_t columns_ = 1;                           ///< of cells
  std::vector<float> until_row_;                      ///< by column and row: part of the column's flux up to there
  std::vector<double> until_column_;                  ///< lumens up to there
};

}  // namespace radiosity::scene
