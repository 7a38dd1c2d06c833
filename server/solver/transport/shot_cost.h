// About how long shots take, to cut work into pieces of similar length. Pure values.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>

#include "server/solver/transport/transport.h"

namespace radiosity::solver {

/// In pixels of visibility, and what takes as long as so many.
struct ShotCost {
  double triangles;        ///< of the scene: culling and drawing one costs about as much as kTrianglePixels
  double receivers = 0.0;  ///< that a gathered shot weighs and each of its points looks at, where it names none

  static constexpr double kTrianglePixels = 4.0;
  static constexpr double kReceiverPixels = 0.5, kNamedPixels = 5000.0;
  static constexpr double kLampPixels = 20.0;  ///< a ray, and a closed form in double precision
  [[nodiscard]] double operator()(const ScatterShot& shot) const { return hemicube(shot.resolution); }
  [[nodiscard]] double operator()(const GatherShot& shot) const {
    const double looks = shot.run_count > 0 ? kNamedPixels : kReceiverPixels * receivers;
    return looks + shot.point_count * (looks + hemicube(shot.resolution));
  }
  [[nodiscard]] double operator()(const PointShot& shot) const { return hemicube(shot.resolution); }
  [[nodiscard]] double operator()(const LampShot& shot) const {
    return kLampPixels * shot.receivers.count * std::max(receivers, 1.0);
  }
  [[nodiscard]] double operator()(const ParallelShot& shot) const {
    return shot.view_count * (double{1.0} * shot.resolution * shot.resolution + kTrianglePixels * triangles);
  }

 private:
  /// A top face of N x N pixels and four half faces.
  [[nodiscard]] double hemicube(double resolution) const {
    return 3.0 * resolution * resolution + kTrianglePixels * triangles;
  }
};

/// Looks at gathered light in a wave that forgets its links, at most: half a second of one core or so, since a limit of
/// time waits for the wave under way. Each leaf looks from each point, and an image of it takes as long as this many.
inline constexpr std::size_t kLooksAWave = 6'000'000, kLooksOfPoint = 16'000;
/// Two halves of two points at least.
[[nodiscard]] inline std::uint32_t pointsAWave(std::size_t leaves) {
  return static_cast<std::uint32_t>(std::max<std::size_t>(4, kLooksAWave / (leaves + kLooksOfPoint)));
}

}  // namespace radiosity::solver
