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

/// Uniform in [0, 1) from a key; for decisions that need no stratification.
[[nodiscard]] double uniformFromKey(std::uint64_t key);

}  // namespace radiosity::solver
