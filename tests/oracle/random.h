// Random numbers of the oracle: a small generator for path vertices, and a low-discrepancy sequence for the first ones.
#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>

namespace radiosity::oracle {

/// splitmix64 (Steele, Lea and Flood 2014): also used to turn a tuple of numbers into a seed.
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed) {}

  std::uint64_t next() {
    state_ += 0x9E3779B97F4A7C15ULL;
    auto z = state_;
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9ULL;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBULL;
    return z ^ (z >> 31);
  }

  /// Uniform in [0, 1).
  double uniform() { return static_cast<double>(next() >> 11) * 0x1.0p-53; }

  [[nodiscard]] static std::uint64_t seedFrom(std::uint64_t a, std::uint64_t b, std::uint64_t c) {
    Random mixed(a);
    Random again(mixed.next() ^ (b * 0xD1342543DE82EF95ULL));
    return Random(again.next() ^ (c * 0xAF251AF3B0F025B5ULL)).next();
  }

 private:
  std::uint64_t state_;
};

/// Additive recurrence on powers of the generalised golden ratio (Roberts 2018), shifted at random.
template <std::size_t kDimensions>
class ShiftedLattice {
 public:
  explicit ShiftedLattice(Random& random) {
    double ratio = 2.0;
    for (int i = 0; i < 60; ++i) ratio = std::pow(1.0 + ratio, 1.0 / (static_cast<double>(kDimensions) + 1.0));
    double step = 1.0;
    for (std::size_t d = 0; d < kDimensions; ++d) {
      step /= ratio;
      step_[d] = step;
      shift_[d] = random.uniform();
    }
  }

  [[nodiscard]] std::array<double, kDimensions> point(std::uint32_t index) const {
    std::array<double, kDimensions> x{};
    for (std::size_t d = 0; d < kDimensions; ++d) {
      const double v = shift_[d] + step_[d] * index;
      x[d] = v - std::floor(v);
    }
    return x;
  }

 private:
  std::array<double, kDimensions> step_{}, shift_{};
};

}  // namespace radiosity::oracle
