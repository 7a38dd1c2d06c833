#include "server/solver/reflected/leaf_smoother.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <utility>
#include <vector>

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

/// The same a leaf at a time, in double: means of nine, and sums over squares, as they are said to be.
class PlainSmoother {
 public:
  using Values = std::array<std::array<std::vector<double>, 3>, 2>;  ///< by half and channel
  PlainSmoother(const Side& side, const std::vector<float>& area, const std::vector<bool>& parted)
      : width_(static_cast<int>(side.width)), height_(static_cast<int>(side.height)), area_(area), parted_(parted) {}

  void smooth(Values& halves) {
    raw_ = halves;
    for (const auto& [step, one_sided] : {std::pair{1, false}, {2, false}, {4, false}, {1, true}, {2, true}}) {
      if (one_sided ? !takesEnds(width_, step) && !takesEnds(height_, step) : std::max(width_, height_) <= 2 * step)
        continue;
      pass(step, one_sided, halves);
    }
  }

 private:
  [[nodiscard]] static bool takesEnds(int size, int step) { return size <= 12 && size > step; }
  [[nodiscard]] bool isOn(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }
  [[nodiscard]] std::size_t leafAt(int x, int y) const { return static_cast<std::size_t>(y * width_ + x); }

  /// Nothing parted from one leaf to the other.
  [[nodiscard]] bool isOpen(int x, int y, int dx, int dy, int step) const {
    for (int k = 0; k <= step; ++k)
      if (!isOn(x + k * dx, y + k * dy) || parted_[leafAt(x + k * dx, y + k * dy)]) return false;
    return true;
  }
  [[nodiscard]] bool isNearParted(int x, int y) const {
    for (int v = y - 4; v <= y + 4; ++v)
      for (int u = x - 4; u <= x + 4; ++u)
        if (isOn(u, v) && parted_[leafAt(u, v)]) return true;
    return false;
  }
  /// Whether a neighbour counts, along one dimension.
  [[nodiscard]] static bool counts(int at, int to, int mirror, int size, bool ends) {
    const auto isThere = [&](int i) { return i >= 0 && i < size; };
    return to == at || (isThere(to) && (ends || isThere(mirror)));
  }

  [[nodiscard]] double mean(const std::vector<double>& of, int x, int y, int step, bool one_sided) const {
    double sum = 0.0, all = 0.0;
    const bool apart = isNearParted(x, y);
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int u = x + dx * step, v = y + dy * step;
        if (apart ? !isOpen(x, y, dx, dy, step) || (!one_sided && !isOpen(x, y, -dx, -dy, step))
                  : !counts(x, u, 2 * x - u, width_, one_sided && takesEnds(width_, step)) ||
                        !counts(y, v, 2 * y - v, height_, one_sided && takesEnds(height_, step)))
          continue;
        const double weight = (dx == 0 ? 2.0 : 1.0) * (dy == 0 ? 2.0 : 1.0) * static_cast<double>(area_[leafAt(u, v)]);
        sum += weight * of[leafAt(u, v)];
        all += weight;
      }
    }
    return all > 0.0 ? sum / all : of[leafAt(x, y)];
  }

  void pass(int step, bool one_sided, Values& now) const {
    const std::size_t count = area_.size();
    Values means;
    for (std::size_t h = 0; h < 2; ++h) {
      for (std::size_t c = 0; c < 3; ++c) {
        for (int y = 0; y < height_; ++y)
          for (int x = 0; x < width_; ++x) means[h][c].push_back(mean(now[h][c], x, y, step, one_sided));
      }
    }
    std::vector<double> slope(count, 0.0), bend(count, 0.0);
    for (std::size_t v = 0; v < count; ++v) {
      for (std::size_t c = 0; c < 3; ++c) {
        const double p0 = now[0][c][v] - raw_[0][c][v], p1 = now[1][c][v] - raw_[1][c][v];
        const double q0 = means[0][c][v] - now[0][c][v], q1 = means[1][c][v] - now[1][c][v];
        const double area = static_cast<double>(area_[v]);
        slope[v] += area * (0.5 * (p0 * q1 + q0 * p1) + 0.25 * (now[0][c][v] - now[1][c][v]) * (q0 - q1));
        bend[v] += area * (q0 * q1 + 0.25 * (q0 - q1) * (q0 - q1));
      }
    }
    const auto around = [&](const std::vector<double>& values, int x, int y) {
      double sum = 0.0;
      for (int v = std::max(0, y - 6); v <= std::min(height_ - 1, y + 6); ++v)
        for (int u = std::max(0, x - 6); u <= std::min(width_ - 1, x + 6); ++u) sum += values[leafAt(u, v)];
      return sum;
    };
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) {
        const double s = around(slope, x, y), b = around(bend, x, y);
        const double part = s >= 0.0 ? 0.0 : b > -s ? -s / b : 1.0;
        for (std::size_t h = 0; h < 2; ++h) {
          for (std::size_t c = 0; c < 3; ++c)
            now[h][c][leafAt(x, y)] += part * (means[h][c][leafAt(x, y)] - now[h][c][leafAt(x, y)]);
        }
      }
    }
  }

  int width_, height_;
  const std::vector<float>& area_;
  const std::vector<bool>& parted_;
  Values raw_;
};

// Sides of all sizes, narrower than what is averaged too, of which a fifth of the leaves have no area and some are
// parted.
TEST(LeafSmoother, DoesWhatAPlainOneDoes) {
  std::mt19937 random(7);
  std::uniform_int_distribution<std::uint32_t> size(1, 30);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  std::normal_distribution<float> off(0.0F, 0.1F);
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<Side> sides(1);
    sides[0].width = size(random);
    sides[0].height = size(random);
    sides[0].leaf_count = sides[0].width * sides[0].height;
    SCOPED_TRACE(std::to_string(sides[0].width) + " x " + std::to_string(sides[0].height));
    std::vector<float> area(sides[0].leaf_count);
    for (auto& a : area) a = unit(random) < 0.2F ? 0.0F : 0.1F + unit(random);
    std::vector<bool> parted(area.size(), false);
    for (std::size_t v = 0; v < area.size() && trial % 2 == 1; ++v) parted[v] = area[v] > 0.0F && unit(random) < 0.02F;
    std::array<LeafSmoother::Light, 2> halves;
    PlainSmoother::Values expected;
    for (std::size_t h = 0; h < 2; ++h) {
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t v = 0; v < area.size(); ++v) {
          halves[h][c].push_back(1.0F + 0.01F * static_cast<float>(v % sides[0].width) + off(random));
          expected[h][c].push_back(static_cast<double>(halves[h][c].back()));
        }
      }
    }
    LeafSmoother smoother(sides, area, [&](std::uint32_t v) { return parted[v]; });
    smoother.smooth(halves);
    PlainSmoother(sides[0], area, parted).smooth(expected);
    for (std::size_t h = 0; h < 2; ++h) {
      for (std::size_t c = 0; c < 3; ++c) {
        for (std::size_t v = 0; v < area.size(); ++v)
          ASSERT_NEAR(static_cast<double>(halves[h][c][v]), expected[h][c][v], 2e-4) << h << ' ' << c << ' ' << v;
      }
    }
  }
}

// Squares of lux like these are beyond single precision.
TEST(LeafSmoother, SmoothsWhatIsVeryBrightAndVeryDark) {
  Field usual([](auto, auto) { return 1.0; }, 0.1, 1);
  LeafSmoother smoother(usual.sides, usual.area);
  auto scaled = usual.halves;
  smoother.smooth(usual.halves);
  const double bias = smoother.bias();
  for (const int exponent : {80, -80}) {
    auto halves = scaled;
    for (auto& half : halves)
      for (auto& channel : half)
        for (auto& value : channel) value = std::ldexp(value, exponent);
    smoother.smooth(halves);
    EXPECT_EQ(std::ldexp(halves[0][0][100], -exponent), usual.halves[0][0][100]);
    EXPECT_NEAR(std::ldexp(smoother.bias(), -2 * exponent), bias, 1e-9 * bias);
  }
}

}  // namespace
}  // namespace radiosity::solver
