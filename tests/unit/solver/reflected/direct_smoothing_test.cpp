#include "server/solver/reflected/direct_smoothing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace radiosity::solver {
namespace {

constexpr std::uint32_t kShadowSize = 32;

/// A side of square leaves under a lamp whose shadow has a wide edge.
struct ShadowField {
  std::vector<Side> sides{1};
  std::vector<float> area = std::vector<float>(kShadowSize * kShadowSize, 1.0F / (kShadowSize * kShadowSize));
  std::vector<float> truth;
  DirectSmoothing::Halves halves;

  explicit ShadowField(float noise) {
    sides[0].width = sides[0].height = kShadowSize;
    sides[0].leaf_count = kShadowSize * kShadowSize;
    std::mt19937 random(1);
    std::normal_distribution<float> off(0.0F, noise);
    for (std::uint32_t leaf = 0; leaf < kShadowSize * kShadowSize; ++leaf) {
      truth.push_back(100.0F + static_cast<float>(leaf % kShadowSize));
      for (auto& half : halves) half.push_back(glm::vec3(truth.back() + (noise > 0.0F ? off(random) : 0.0F)));
    }
  }
  [[nodiscard]] double off() const {
    double sum = 0.0;
    for (std::size_t v = 0; v < truth.size(); ++v) {
      for (int c = 0; c < 3; ++c)
        sum += static_cast<double>(area[v] * std::pow(0.5F * (halves[0][v][c] + halves[1][v][c]) - truth[v], 2.0F));
    }
    return sum;
  }
};

TEST(DirectSmoothing, TakesOutGrainAndSaysWhatItCost) {
  ShadowField field(5.0F);
  const double before = field.off();
  DirectSmoothing smoothing;
  EXPECT_TRUE(smoothing.biasOfLeaves().empty());
  smoothing.smooth(field.sides, field.area, {}, field.halves);
  EXPECT_LT(field.off(), 0.25 * before);
  double differ = 0.0;
  for (std::size_t v = 0; v < field.truth.size(); ++v) {
    const auto off = 0.5F * (field.halves[0][v] - field.halves[1][v]);
    differ += static_cast<double>(field.area[v] * (off.x * off.x + off.y * off.y + off.z * off.z));
  }
  EXPECT_GE(differ + smoothing.bias(), field.off()) << "what is stated";
  EXPECT_GT(smoothing.bias(), 0.0);
  ASSERT_EQ(smoothing.biasOfLeaves().size(), field.truth.size());
  double sum = 0.0;
  for (std::size_t v = 0; v < field.truth.size(); ++v)
    sum += static_cast<double>(field.area[v] * smoothing.biasOfLeaves()[v]);
  EXPECT_NEAR(sum, smoothing.bias(), 0.01 * smoothing.bias() + 1e-9);
}

TEST(DirectSmoothing, LeavesLightThatIsKnownAlone) {
  ShadowField field(0.0F);
  const auto before = field.halves;
  DirectSmoothing smoothing;
  smoothing.smooth(field.sides, field.area, {}, field.halves);
  EXPECT_EQ(field.halves, before);
  EXPECT_EQ(smoothing.bias(), 0.0);
}

TEST(DirectSmoothing, TakesNoMeanAcrossWhatPartsLight) {
  ShadowField field(5.0F);
  const auto before = field.halves;
  DirectSmoothing smoothing;
  smoothing.smooth(
      field.sides, field.area, [](std::uint32_t value) { return value == 0; }, field.halves);
  EXPECT_EQ(field.halves[0][0], before[0][0]);
  EXPECT_NE(field.halves[0][kShadowSize * 8 + 8], before[0][kShadowSize * 8 + 8]);
}

}  // namespace
}  // namespace radiosity::solver
