// What colour the light of a shooter has where it arrives through coloured glass: its links carry that of the channel
// that passes best. Plain values; any thread.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

namespace radiosity::solver {

class LinkTint {
 public:
  /// Of the next leaves, which have larger leaf values than those before.
  void add(std::uint32_t first, std::uint32_t count, const glm::vec3& tint) {
    if (tint == glm::vec3(1.0F) || count == 0) return;
    if (!runs_.empty() && runs_.back().first + runs_.back().count == first && runs_.back().tint == tint) {
      runs_.back().count += count;
    } else {
      runs_.push_back({first, count, tint});
    }
  }
  void add(const LinkTint& next) {
    for (const auto& run : next.runs_) add(run.first, run.count, run.tint);
  }

  /// Nothing coloured lies before any leaf.
  [[nodiscard]] bool empty() const { return runs_.empty(); }
  /// 1 where the light has all its colour.
  [[nodiscard]] glm::vec3 at(std::uint32_t value) const {
    const auto next = std::ranges::upper_bound(runs_, value, {}, &Run::first);
    if (next == runs_.begin() || value - next[-1].first >= next[-1].count) return glm::vec3(1.0F);
    return next[-1].tint;
  }
  /// Multiplies light by leaf value, a plane a channel.
  void apply(const std::array<float*, 3>& light) const {
    for (const auto& run : runs_) {
      for (std::size_t c = 0; c < 3; ++c) {
        const float tint = run.tint[static_cast<int>(c)];
        for (auto value = run.first; value < run.first + run.count; ++value) light[c][value] *= tint;
      }
    }
  }
  [[nodiscard]] std::size_t bytes() const { return runs_.size() * sizeof(Run); }
  /// What one run takes.
  static constexpr std::size_t kRunBytes = 20;

 private:
  struct Run {
    std::uint32_t first, count;
    glm::vec3 tint;
  };
  static_assert(sizeof(Run) == kRunBytes);
  std::vector<Run> runs_;
};

}  // namespace radiosity::solver
