// How many rays of each leaf are lost, in four bytes of a leaf: where more than 254 are, as few leaves have that have
// thousands of rays, in a list. Plain values.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace radiosity::solver {

class LostRays {
 public:
  /// Of a leaf's rays: into the sky, on unlit sides, and of which it is not told where they end.
  struct Counts {
    std::uint16_t above = 0, below = 0, absorbed = 0, doubtful = 0;
    bool operator==(const Counts&) const = default;
  };

  LostRays() = default;
  explicit LostRays(std::size_t leaves) : few_(leaves) {}

  /// Leaves in ascending order, each once at most; of the others none are lost.
  void add(std::uint32_t value, const Counts& counts) {
    const bool is_few = std::max({counts.above, counts.below, counts.absorbed, counts.doubtful}) < kMany;
    if (!is_few) many_.emplace_back(value, counts);
    const auto few = [&](std::uint16_t count) { return static_cast<std::uint8_t>(is_few ? count : kMany); };
    few_[value] = {few(counts.above), few(counts.below), few(counts.absorbed), few(counts.doubtful)};
  }
  [[nodiscard]] Counts at(std::size_t value) const {
    const auto& few = few_[value];
    if (few[0] != kMany) return {few[0], few[1], few[2], few[3]};
    return std::ranges::lower_bound(many_, value, {}, [](const auto& of) { return std::size_t{of.first}; })->second;
  }
  [[nodiscard]] bool hasAny(std::size_t value) const {
    return !few_.empty() && std::bit_cast<std::uint32_t>(few_[value]) != 0;
  }
  [[nodiscard]] bool empty() const { return few_.empty(); }
  [[nodiscard]] bool isNothing() const {
    return std::ranges::all_of(few_, [](const auto& few) { return few == std::array<std::uint8_t, 4>{}; });
  }

 private:
  static constexpr std::uint8_t kMany = 0xFF;
  std::vector<std::array<std::uint8_t, 4>> few_;
  std::vector<std::pair<std::uint32_t, Counts>> many_;  ///< ascending
};

}  // namespace radiosity::solver
