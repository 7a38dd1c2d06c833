// What a step of a ray says that a mirror reflected, or that went through coloured glass (LeafSights::Step::by): which
// leaf, and how, in 32 bits. Colours of mirrors are not in it, so that an edit of them needs no new ray. Plain values.
#pragma once

#include <algorithm>
#include <cstdint>

namespace radiosity::solver {

struct SpecularStep {
  /// Leaves have numbers below this; of the rest of a number one bit says that it is such a step.
  static constexpr std::uint32_t kMostLeaves = std::uint32_t{1} << 26;

  std::uint32_t leaf = 0;
  std::uint32_t level = 0;  ///< of kLevels: Schlick's (1 - cos)^5
  /// The ray was reflected before, between microfacets of the same leaf: what that sends by itself is counted then.
  bool is_again = false;

  [[nodiscard]] float edge() const { return static_cast<float>(level) / static_cast<float>(kLevels - 1); }
  [[nodiscard]] std::uint32_t code() const {
    return kIsSpecular | (is_again ? kIsAgain : 0U) | level << kLevelShift | leaf;
  }
  [[nodiscard]] static bool is(std::uint32_t code) { return (code & kIsSpecular) != 0; }
  [[nodiscard]] static SpecularStep of(std::uint32_t code) {
    return {code & (kMostLeaves - 1), code >> kLevelShift & (kLevels - 1), (code & kIsAgain) != 0};
  }
  /// The level on either side of `edge`, by chance (uniform in [0, 1)), so that the mean is right.
  [[nodiscard]] static std::uint32_t levelOf(double edge, double chance) {
    return std::min(kLevels - 1, static_cast<std::uint32_t>(edge * (kLevels - 1) + chance));
  }

 private:
  static constexpr std::uint32_t kLevels = 16, kLevelShift = 26;
  static constexpr std::uint32_t kIsAgain = std::uint32_t{1} << 30, kIsSpecular = std::uint32_t{1} << 31;
};

struct PaneStep {
  std::uint32_t tint = 0;  ///< into PatchScene::leaf_tints, below 2^30

  [[nodiscard]] std::uint32_t code() const { return kIsPane | tint; }
  [[nodiscard]] static bool is(std::uint32_t code) { return code >> 30U == 1U; }
  [[nodiscard]] static PaneStep of(std::uint32_t code) { return {code & (kIsPane - 1)}; }

 private:
  static constexpr std::uint32_t kIsPane = std::uint32_t{1} << 30;
};

}  // namespace radiosity::solver
