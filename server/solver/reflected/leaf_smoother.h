// Takes out of gathered light what single leaves got by chance, where their neighbours tell: light that comes from all
// around changes little from leaf to leaf, and the noise of rays does not know of the next leaf's. Each leaf moves
// towards the mean of those around it, on its own side, as far as that lowers the error: two independent halves tell
// how much noise that takes away and how much of the light itself. (Wavelets with holes: Dammertz and others 2010,
// "Edge-avoiding a-trous wavelet transform"; errors from two halves: Rousselle, Knaus and Zwicker 2012, "Adaptive
// rendering with non-local means filtering".) Plain values; one thread outside of the calls, which use all cores.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/solver/patches/side.h"

namespace radiosity::solver {

class LeafSmoother {
 public:
  /// By channel and leaf value. In single precision: what it works with is far above the rounding of that.
  using Light = std::array<std::vector<float>, 3>;

  /// `area`: by leaf value, 0 where there is no leaf. Both are to outlive it. `is_parted`: by leaf value, whether light
  /// may be another on both sides of something that stands there: no mean is taken of it, nor across it.
  LeafSmoother(const std::vector<Side>& sides, std::span<const float> area,
               const std::function<bool(std::uint32_t)>& is_parted = {});

  /// Smooths both halves (by leaf value), and remembers how. O(leaves).
  void smooth(std::array<Light, 2>& halves);
  /// Does the same to other values.
  void apply(Light& values) const;
  /// The same to those of one side, by channel and leaf.
  void apply(std::size_t side, const std::array<float*, 3>& values) const;
  /// What it took of the light itself, or put where there was less, and what was gained by chance: squares of it, times
  /// area, all leaves and channels. An estimate, of which what was taken is not below zero.
  [[nodiscard]] double bias() const { return bias_; }
  /// The same by leaf value, not times area, shared out over leaves that are near: together bias(). O(leaves).
  [[nodiscard]] std::vector<float> biasOfLeaves() const;
  /// How it smoothed, until it does again, and with it what all but smooth() needs.
  void forget();

 private:
  struct Room;
  void smoothSide(const Side& side, std::size_t pass, const std::array<Light, 2>& raw, std::array<Light, 2>& halves,
                  Room& room);
  /// So far apart are leaves that passes average.
  static constexpr std::array<std::uint32_t, 3> kSteps{1, 2, 4};
  /// Which leaves are averaged: so far apart, and whether one may count whose mirror image there is not.
  struct Pass {
    std::size_t step_index;  ///< into kSteps
    bool one_sided;
    [[nodiscard]] std::uint32_t step() const { return kSteps[step_index]; }
    /// Whether it does anything along an edge of so many leaves, at its ends.
    [[nodiscard]] bool takesEnds(std::uint32_t size) const;
  };
  static const std::array<Pass, 5> kPasses;
  [[nodiscard]] static bool isFor(const Pass& pass, const Side& side);
  void weigh(const Side& side, const Pass& pass, Room& room) const;
  void chooseParts(const Side& side, Room& room, float* parts) const;
  static void sumAround(const Side& side, const Pass& pass, std::vector<float>& values, std::vector<float>& rows);
  void average(const Side& side, const Pass& pass, const float* from, float* means, Room& room) const;
  void apply(const Side& side, const std::array<float*, 3>& values, Room& room) const;
  /// A leaf of a side, and by step which of the nine around it, as bits, it may be averaged with.
  struct Beside {
    std::uint32_t leaf;
    std::array<std::uint16_t, kSteps.size()> open;
    std::array<bool, kSteps.size()> cut;  ///< other than where nothing stands
  };
  /// A mean of some leaves around one.
  struct Apart {
    std::uint32_t leaf, count;
    std::array<std::uint32_t, 9> with;
    std::array<float, 9> weight;
  };
  [[nodiscard]] Apart apart(const Side& side, const Beside& beside, const Pass& pass) const;
  void findParted(std::size_t s, const std::function<bool(std::uint32_t)>& is_parted);
  [[nodiscard]] std::uint16_t openWays(const Side& side, std::uint32_t leaf, std::uint32_t step) const;
  [[nodiscard]] static std::uint16_t waysWithin(const Side& side, std::uint32_t leaf, std::uint32_t step);

  [[nodiscard]] double areaOf(std::size_t value) const { return static_cast<double>(area_[value]); }

  const std::vector<Side>& sides_;
  std::span<const float> area_;
  std::vector<bool> is_parted_;  ///< by leaf value: nothing is taken of it, nor across it
  /// By side: leaves so near to such leaves that some means may not be taken.
  std::vector<std::vector<Beside>> beside_;
  std::vector<std::vector<float>> towards_;  ///< by pass and leaf value: part of the way to the mean
  std::vector<double> taken_, by_chance_;    ///< by leaf value, times area: see bias(); the former signed
  double bias_ = 0.0;
};

}  // namespace radiosity::solver
