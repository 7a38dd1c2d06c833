// Takes out of the light of lamps what single leaves got by chance. Each leaf looks at points of its own on a lamp, so
// that the edge of a shadow is grainy where few points have looked, and not stepped; its neighbours tell what of that
// is grain. Plain values; one thread outside of the calls, which use all cores.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/solver/patches/side.h"

namespace radiosity::solver {

class DirectSmoothing {
 public:
  /// Irradiance by half and leaf value.
  using Halves = std::array<std::vector<glm::vec3>, 2>;

  /// Smooths both halves as LeafSmoother does, of sides of some width where that lowers the error, and remembers what
  /// it cost. `area`, `is_parted`: as there. Where the halves are the same it changes nothing. O(leaves).
  void smooth(const std::vector<Side>& sides, std::span<const float> area,
              const std::function<bool(std::uint32_t)>& is_parted, Halves& halves);

  /// What was taken of the light itself, as far as is known: squares of it, times area, all leaves and channels.
  [[nodiscard]] double bias() const { return bias_; }
  /// The same by leaf value, not times area; empty before the first time.
  [[nodiscard]] std::span<const float> biasOfLeaves() const { return leaf_bias_; }

  /// After a restore: it is of so many leaves.
  [[nodiscard]] bool fits(std::size_t leaves) const { return leaf_bias_.empty() || leaf_bias_.size() == leaves; }

  template <typename Archive, typename Self>
  static void visit(Archive& archive, Self& self) {
    archive(self.bias_, self.leaf_bias_);
  }

 private:
  double stateMore(const Side& side, std::span<const float> area, double square);

  double bias_ = 0.0;
  std::vector<float> leaf_bias_;
};

}  // namespace radiosity::solver
