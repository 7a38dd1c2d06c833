// Exact pixel weights (delta form factors) of a hemicube as integers, and the layout of its image.
// Cohen and Greenberg 1985, with the closed forms integrated over each pixel's cell. Plain values, any thread.
//
// Layout of one hemicube image: width N; rows 0..N-1 are the top face, then four side faces of N/2 rows each, the row
// at the horizon first. N is even. Pixels are samples at (i + phase) 2/N from the face's edge, phase in (0, 1) by
// lattice index; so every sample lies inside its face, and the cell of a pixel reaches half-way to its neighbours (edge
// cells are a little larger or smaller). The horizon and the edges of the cube are exact.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <mutex>
#include <vector>

#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

inline constexpr std::uint32_t kMinResolution = 4;
inline constexpr std::uint32_t kMaxResolution = 2048;

[[nodiscard]] constexpr std::uint32_t hemicubePixels(std::uint32_t resolution) { return 3 * resolution * resolution; }

/// Where the sample of a pixel lies between the pixel's edges, (across, up), for a lattice index.
[[nodiscard]] std::array<double, 2> latticePhase(std::uint32_t lattice);

/// Form factor of the top face's rectangle [0, x] x [0, y] at height 1.
[[nodiscard]] double topCorner(double x, double y);
/// Form factor of a side face's rectangle [0, y] x [0, z] at distance 1; z: height above the horizon.
[[nodiscard]] double sideCorner(double y, double z);

struct HemicubeWeights {
  /// before[i]: sum of the weights of pixels 0..i-1 in layout order; hemicubePixels + 1 entries, the last is
  /// kWeightOne.
  std::vector<std::uint32_t> before;

  [[nodiscard]] std::uint32_t pixel(std::size_t index) const { return before[index + 1] - before[index]; }
};

[[nodiscard]] HemicubeWeights computeWeights(std::uint32_t resolution, std::uint32_t lattice);

/// Tables made when first asked for and kept: 4 bytes a pixel each. Any thread; who asks for one that is being made
/// waits.
class WeightCache {
 public:
  const HemicubeWeights& get(std::uint32_t resolution, std::uint32_t lattice);

 private:
  std::mutex mutex_;
  struct Table {
    std::once_flag made;
    HemicubeWeights weights;
  };
  std::map<std::pair<std::uint32_t, std::uint32_t>, Table> tables_;
};

}  // namespace radiosity::gpu
