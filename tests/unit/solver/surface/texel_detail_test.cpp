// Where texels are to be finer: where light bends, as far as texels may be had.
#include "server/solver/surface/texel_detail.h"

#include <gtest/gtest.h>

#include <numeric>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

constexpr std::uint32_t kSide = 16;
constexpr double kTexels = 3.0 * kSide * kSide;

/// Three equal walls: light is even on the first, changes evenly on the second, and has an edge on the third.
class TexelDetailTest : public testing::Test {
 protected:
  TexelDetailTest() {
    std::vector<test::Quad> quads;
    for (int i = 0; i < 3; ++i) {
      test::Quad quad{{-0.5F, -0.5F, 0.3F * static_cast<float>(i)}, {1.0F, 0.0F, 0.0F}, {0.0F, 1.0F, 0.0F}};
      quad.width = quad.height = kSide;
      quads.push_back(quad);
    }
    scene_ = test::makeQuadScene(quads);
    light_.assign(scene_.patches->nodeCount(), glm::vec3(0.0F));
    for (std::uint32_t s = 0; s < 3; ++s) {
      for (std::uint32_t leaf = 0; leaf < kSide * kSide; ++leaf) {
        const auto x = static_cast<float>(leaf % kSide);
        light_[scene_.patches->surfaces[s].first_node[0] + leaf] = glm::vec3(s == 0     ? 10.0F
                                                                             : s == 1   ? 4.0F + x
                                                                             : x < 7.0F ? 2.0F
                                                                                        : 18.0F);
      }
    }
  }

  /// As if every place were off by the same, all of it by texels.
  [[nodiscard]] TexelDetail choose(const DetailGoal& goal, double off = 1.0) const {
    return chooseDetail(*scene_.patches, {light_, light_, {}}, measured(off), goal);
  }

  /// One place on each surface, between four leaves.
  [[nodiscard]] static std::vector<SurfaceError::Measured> measured(double square) {
    std::vector<SurfaceError::Measured> measured;
    for (std::uint32_t s = 0; s < 3; ++s) measured.push_back({{s, 0, glm::vec2(5.0F, 9.0F)}, square, 1.0});
    return measured;
  }

  test::QuadScene scene_;
  std::vector<glm::vec3> light_;
};

TEST_F(TexelDetailTest, TexelsAreFinerWhereLightBendsAndCoarserWhereItDoesNot) {
  const auto chosen = choose({0.02, 1e6});
  ASSERT_EQ(chosen.of_surface.size(), 3U);
  EXPECT_LT(chosen.of_surface[0], 1.0F);
  EXPECT_LT(chosen.of_surface[1], 1.0F);  // a slope is what a lookup makes of its texels
  EXPECT_GT(chosen.of_surface[2], 2.0F);
  EXPECT_LE(chosen.error, 0.02 * 1.001);
}

TEST_F(TexelDetailTest, AsFewAsMeetTheGoal) {
  const auto loose = choose({0.1, 1e6}), tight = choose({0.02, 1e6});
  EXPECT_LT(loose.texels, tight.texels);
  EXPECT_NEAR(loose.error, 0.1, 0.001);
  EXPECT_NEAR(tight.error, 0.02, 0.0002);
}

TEST_F(TexelDetailTest, NoMoreThanThereMayBe) {
  const auto chosen = choose({0.001, 2.0 * kTexels});
  EXPECT_LE(chosen.texels, 2.0 * kTexels * 1.001);
  EXPECT_GT(chosen.texels, 1.5 * kTexels);
  EXPECT_GT(chosen.error, 0.001);
}

// Texels that are as fine as any may be promise nothing, and such as coarse as any may be save nothing.
TEST_F(TexelDetailTest, WhatIsAtItsEndStaysThere) {
  scene_.patches->surfaces[0].detail = 0.5F;
  scene_.patches->surfaces[2].detail = 64.0F;
  const auto chosen = choose({0.001, 1e9});
  EXPECT_EQ(chosen.of_surface[0], 0.5F);
  EXPECT_EQ(chosen.of_surface[2], 64.0F);
  EXPECT_GT(chosen.error, 0.01);
}

TEST_F(TexelDetailTest, MoreThatIsMeasuredAsksForMore) {
  EXPECT_GT(choose({0.02, 1e6}, 4.0).texels, choose({0.02, 1e6}).texels);
}

// What both halves are off by is no fault of texels either: finer ones would not change it.
TEST_F(TexelDetailTest, WhatSmoothingTookIsNotTheirs) {
  const auto chooseWith = [&](float square) {
    const std::vector<glm::vec3> common(scene_.patches->nodeCount(), glm::vec3(square));
    return chooseDetail(*scene_.patches, {light_, light_, common}, measured(4.0), {0.02, 1e6});
  };
  EXPECT_EQ(chooseWith(0.0F).present, choose({0.02, 1e6}, 4.0).present);
  // Three quarters of the square, over the three surfaces, each of area one and of three channels.
  EXPECT_NEAR(chooseWith(1.0F).present, 0.5 * chooseWith(0.0F).present, 0.01 * chooseWith(0.0F).present);
  EXPECT_LT(chooseWith(1.0F).texels, chooseWith(0.0F).texels);
}

// Halves that bend by chance bend differently: their product is nothing in the mean.
TEST_F(TexelDetailTest, NoiseIsNoBend) {
  auto first = light_, second = light_;
  for (std::uint32_t leaf = 0; leaf < kSide * kSide; ++leaf) {
    const auto node = scene_.patches->surfaces[0].first_node[0] + leaf;
    first[node] *= (leaf * 7919U % 13U) < 6U ? 1.1F : 0.9F;
    second[node] *= (leaf * 104729U % 11U) < 5U ? 1.1F : 0.9F;
  }
  const auto chosen = chooseDetail(*scene_.patches, {first, second, {}}, measured(1.0), {0.02, 1e6});
  EXPECT_LT(chosen.of_surface[0], chosen.of_surface[2] / 2.0F);
}

TEST_F(TexelDetailTest, WithoutLightTexelsAreFewer) {
  std::ranges::fill(light_, glm::vec3(0.0F));
  const auto chosen = choose({0.02, 1e6}, 0.0);
  EXPECT_EQ(chosen.error, 0.0);
  EXPECT_LT(chosen.texels, kTexels);
}

// What both neighbours have alike of noise no lookup averages: it is not the texels' fault.
TEST_F(TexelDetailTest, NoiseThatNeighboursHaveInCommonIsNotThatOfTexels) {
  constexpr float kOff = 1.0F;
  auto second = light_;
  for (auto& value : second) value += 2.0F * kOff;
  const double square = 3.0 * kOff * kOff;  // of the mean of both halves
  const auto alike = chooseDetail(*scene_.patches, {light_, second, {}}, measured(square), {0.02, 1e6});
  const auto without = chooseDetail(*scene_.patches, {light_, light_, {}}, measured(square), {0.02, 1e6});
  EXPECT_LT(alike.present, 0.4 * without.present);
}

// Of four leaves that are off by ones of either sign a lookup in their midst is off by nothing, and one in the middle
// of a leaf by all of it: the noise is that of where lookups were made.
TEST_F(TexelDetailTest, NoiseIsThatOfWhereLookupsWereMade) {
  auto second = light_;
  for (std::uint32_t s = 0; s < 3; ++s) {
    for (std::uint32_t leaf = 0; leaf < kSide * kSide; ++leaf)
      second[scene_.patches->surfaces[s].first_node[0] + leaf] += (leaf % kSide + leaf / kSide) % 2 == 0 ? 2.0F : -2.0F;
  }
  const auto chosenFor = [&](const glm::vec2& offset) {
    auto places = measured(4.0);
    for (auto& place : places) place.lookup.texel += offset;
    return chooseDetail(*scene_.patches, {light_, second, {}}, places, {0.02, 1e6}).present;
  };
  const double all = choose({0.02, 1e6}, 4.0).present;
  EXPECT_NEAR(chosenFor({0.0F, 0.0F}) / all, 1.0, 0.03);
  EXPECT_NEAR(chosenFor({0.5F, 0.5F}) / all, 0.5, 0.03);  // a square of three of four
}

}  // namespace
}  // namespace radiosity::solver
