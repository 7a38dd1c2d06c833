#include "server/solver/leaf_smoother.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace radiosity::solver {
namespace {

constexpr std::uint32_t kSize = 32;

/// A side of square leaves, and what two halves found of a light there.
struct Field {
  std::vector<Side> sides{1};
  std::vector<float> area = std::vector<float>(kSize * kSize, 1.0F / (kSize * kSize));
  std::vector<double> truth;
  std::array<LeafSmoother::Light, 2> halves;

  template <typename Truth>
  Field(const Truth& light, double noise, std::uint32_t seed) {
    sides[0].width = sides[0].height = kSize;
    sides[0].leaf_count = kSize * kSize;
    std::mt19937 random(seed);
    std::normal_distribution<double> off(0.0, noise);
    for (std::uint32_t leaf = 0; leaf < kSize * kSize; ++leaf) truth.push_back(light(leaf % kSize, leaf / kSize));
    for (auto& half : halves) {
      for (const double value : truth) {
        for (std::size_t c = 0; c < 2; ++c) half[c].push_back(static_cast<float>(value + off(random)));
        half[2].push_back(static_cast<float>(value));
      }
    }
  }

  /// Square of the error of the mean of the halves, times area.
  [[nodiscard]] double off() const {
    double sum = 0.0;
    for (std::size_t v = 0; v < truth.size(); ++v) {
      for (std::size_t c = 0; c < 3; ++c)
        sum += area[v] * std::pow(0.5 * (halves[0][c][v] + halves[1][c][v]) - truth[v], 2.0);
    }
    return sum;
  }
  [[nodiscard]] double betweenHalves() const {
    double sum = 0.0;
    for (std::size_t v = 0; v < truth.size(); ++v) {
      for (std::size_t c = 0; c < 3; ++c) sum += area[v] * 0.25 * std::pow(halves[0][c][v] - halves[1][c][v], 2.0);
    }
    return sum;
  }
};

TEST(LeafSmoother, TakesNearlyAllNoiseOfEvenLight) {
  Field field([](auto, auto) { return 1.0; }, 0.1, 1);
  const double before = field.off();
  LeafSmoother smoother(field.sides, field.area);
  smoother.smooth(field.halves);
  EXPECT_LT(field.off(), 0.1 * before);  // binomial means of three passes leave a fiftieth
}

TEST(LeafSmoother, LeavesLightWithoutNoiseAlone) {
  Field field([](std::uint32_t x, std::uint32_t y) { return x < 11 ? 1.0 : 5.0 + 0.1 * y; }, 0.0, 1);
  const auto before = field.halves;
  LeafSmoother smoother(field.sides, field.area);
  smoother.smooth(field.halves);
  EXPECT_EQ(field.halves, before);
  EXPECT_EQ(smoother.bias(), 0.0);
}

// An edge many times the noise would lose more than is gained around it.
TEST(LeafSmoother, StatesWhatIsLeftBesideAnEdge) {
  double off = 0.0, stated = 0.0, before = 0.0;
  constexpr int kSeeds = 20;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    Field field([](std::uint32_t x, auto) { return x < 11 ? 1.0 : 2.0; }, 0.1, static_cast<std::uint32_t>(seed));
    before += field.off();
    LeafSmoother smoother(field.sides, field.area);
    smoother.smooth(field.halves);
    off += field.off();
    stated += field.betweenHalves() + smoother.bias();
  }
  EXPECT_LT(off, 0.8 * before);
  EXPECT_GT(off / stated, 1.0 / (1.5 * 1.5)) << "squares: a factor of 1.5, as of all that is stated";
  EXPECT_LT(off / stated, 1.5 * 1.5);
}

// Light that changes evenly up to the edges is left as it is there: means of what lies on one side would move it.
TEST(LeafSmoother, MovesNoEdgeOfWideSides) {
  double off = 0.0, moved = 0.0;
  constexpr int kSeeds = 40;
  for (int seed = 1; seed <= kSeeds; ++seed) {
    Field field([](std::uint32_t x, auto) { return 1.0 + 0.05 * x; }, 0.1, static_cast<std::uint32_t>(seed));
    LeafSmoother smoother(field.sides, field.area);
    smoother.smooth(field.halves);
    for (std::uint32_t y = 0; y < kSize; ++y) {
      const auto leaf = y * kSize;
      const double mean = 0.5 * (field.halves[0][0][leaf] + field.halves[1][0][leaf]);
      moved += (mean - field.truth[leaf]) / (kSize * kSeeds);
      off += std::pow(mean - field.truth[leaf], 2.0) / (kSize * kSeeds);
    }
  }
  EXPECT_LT(off, 0.25 * 0.1 * 0.1 / 2.0) << "the noise of a mean of two is smoothed along the edge";
  // The mean of 40 x 32 whose noise goes together over some six is uncertain to 0.005; means of one side make it 0.03.
  EXPECT_NEAR(moved, 0.0, 0.015);
}

// A wall stands on a column of leaves, with the day on one side and the night on the other.
TEST(LeafSmoother, TakesNoMeanAcrossAWall) {
  constexpr std::uint32_t kWall = 11;
  Field field([](std::uint32_t x, auto) { return x < kWall ? 1.0 : x > kWall ? 0.0 : 0.3; }, 0.0, 1);
  for (auto& half : field.halves) {  // noise of the day, none of the night
    std::mt19937 random(&half == &field.halves[0] ? 1 : 2);
    std::normal_distribution<double> off(0.0, 0.3);
    for (std::uint32_t leaf = 0; leaf < kSize * kSize; ++leaf) {
      if (leaf % kSize < kWall) half[0][leaf] += static_cast<float>(off(random));
    }
  }
  const auto raw = field.halves;
  LeafSmoother smoother(field.sides, field.area, [](std::uint32_t leaf) { return leaf % kSize == kWall; });
  smoother.smooth(field.halves);
  constexpr std::uint32_t kBeside = kSize / 2 * kSize + kWall - 1;
  EXPECT_NE(field.halves[0][0][kBeside], raw[0][0][kBeside]) << "nothing is smoothed";
  for (std::uint32_t leaf = 0; leaf < kSize * kSize; ++leaf) {
    if (leaf % kSize >= kWall) {
      for (std::size_t c = 0; c < 3; ++c) ASSERT_EQ(field.halves[0][c][leaf], raw[0][c][leaf]) << leaf;
    }
  }
}

TEST(LeafSmoother, DoesToOtherValuesWhatItDid) {
  Field field([](std::uint32_t x, auto) { return 0.01 * x; }, 0.1, 3);
  auto other = field.halves[0];
  LeafSmoother smoother(field.sides, field.area);
  smoother.smooth(field.halves);
  smoother.apply(other);
  EXPECT_EQ(other, field.halves[0]);
}

}  // namespace
}  // namespace radiosity::solver
