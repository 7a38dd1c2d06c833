// Low-discrepancy points for shooters and light points. Pure functions: the same key and index give the same point on
// any machine and in any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec4.hpp>

namespace radiosity::solver {

/// Mixes two 64-bit values into one (splitmix64 finaliser); keys for streams that must not be correlated.
[[nodiscard]] std::uint64_t mixKeys(std::uint64_t a, std::uint64_t b);

/// Point `index` of the first four dimensions of the Sobol sequence, Owen-scrambled by hashing (Burley, "Practical
/// Hash-based Owen Scrambling", JCGT 2020). Components in [0, 1).
[[nodiscard]] glm::dvec4 sobol4(std::uint32_t index, std::uint64_t key);

/// The same points where many of one key are wanted.
class Sobol4 {
 public:
  explicit Sobol4(std::uint64_t key);
  [[nodiscard]] glm::dvec4 operator()(std::uint32_t index) const;

 private:
  std::uint32_t shuffle_;
  std::array<std::uint32_t, 4> scramble_;
};

/// A 32-bit number of a draw with the binary digits that `by` names turned over, as a fraction in [0, 1). Draws of
/// which all are turned by the same stay as evenly spread as they were; numbers that are shifted, and wrap round, have
/// 1.4 times the error. (Kollig and Keller 2002, "Efficient multidimensional sampling": random digit scrambling.)
/// Inline, so that loops over it vectorise.
[[nodiscard]] inline float turnedOver(std::uint32_t number, std::uint32_t by) {
  return static_cast<float>(static_cast<std::int32_t>((number ^ by) >> 8U)) * 0x1p-24F;
}

/// The n-th of those that look at points of their own turns these digits of a draw's two numbers, times n: so those
/// beside each other look at points that are spread evenly. Roberts 2018, "The unreasonable effectiveness of
/// quasirandom sequences"; of 2^32, 0.7549 and 0.5698.
inline constexpr std::uint32_t kTurnU = 3242174889U, kTurnV = 2447445414U;

/// Uniform in [0, 1) from a key; for decisions that need no stratification.
[[nodiscard]] double uniformFromKey(std::uint64_t key);

}  // namespace radiosity::solver
