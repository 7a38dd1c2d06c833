#include "server/solver/lamps/light_tints.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <vector>

#include "server/solver/reflected/specular_step.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::makeQuadScene;

constexpr std::uint8_t kOpacity = 102;  // three fifths pass of red
constexpr float kPasses = 0.6F;
const glm::vec3 kTint(1.0F, 0.5F, 0.2F);

/// A floor of one square below a sheet of coloured glass that covers its left half, and a lamp above both, in the
/// middle, so wide. Lengths are those of the unit box.
class HalfBehindGlass : public testing::Test {
 protected:
  void make(float lamp_width) {
    const float half = 0.5F * lamp_width;
    auto made = makeQuadScene({{{-0.5F, -0.5F, -0.5F}, {0, 0, 1}, {1, 0, 0}, 16, 16, {}, glm::vec3(0.5F)},
                               {{-half, 0.5F, -half}, {lamp_width, 0, 0}, {0, 0, lamp_width}, 1, 1, glm::vec3(1.0F)},
                               {{-0.5F, 0.0F, -0.5F}, {0, 0, 1}, {0.5F, 0, 0}, 1, 1}});
    patches_ = made.patches;
    patches_->opacity = {kOpacity};
    patches_->tints = {glm::u16vec3(glm::round(kTint * float{scene::PatchScene::kTintSteps}))};
    patches_->leaf_tints = {kTint};
    auto& pane = patches_->surfaces[2];
    pane.see_through = true;
    pane.first_tint = pane.first_tint_cell = 0;
    pane.bounds_min = {-0.5F, 0.0F, -0.5F};
    pane.bounds_max = {0.0F, 0.0F, 0.5F};
    patches_->surfaces[0].bounds_min = {-0.5F, -0.5F, -0.5F};
    patches_->surfaces[0].bounds_max = {0.5F, -0.5F, 0.5F};
    sides_ = makeSides(*patches_);
    lamp_ = findLightPolygons(*patches_, sides_, made.materials.emission).at(0);
    rays_ = std::make_shared<const LeafRays>(*patches_, sides_);
  }

  [[nodiscard]] std::unique_ptr<LightTints> tints(double times = 1.0, double seconds = 1e6,
                                                  std::size_t most_bytes = 1U << 20U) const {
    auto made = std::make_unique<LightTints>(*patches_, sides_, 1, most_bytes);
    while (times > 1.0 && made->refine(times)) times /= 4.0;
    made->begin({LightTints::of(lamp_)}, rays_);
    while (!made->advance(seconds)) continue;
    return made;
  }
  [[nodiscard]] static glm::vec3 at(const LightTints& tints, std::uint32_t leaf, std::size_t half) {
    const auto tint = tints.tint(0, half);
    return tint ? tint->at(leaf) : glm::vec3(1.0F);
  }
  /// Of a leaf of the floor, unit box.
  [[nodiscard]] float across(std::uint32_t leaf) const {
    return static_cast<float>(rays_->placeOn(leaf, {0.5, 0.5}).position.x);
  }

  std::shared_ptr<scene::PatchScene> patches_;
  std::vector<Side> sides_;
  LightPolygon lamp_;
  std::shared_ptr<const LeafRays> rays_;
};

TEST_F(HalfBehindGlass, LeavesHaveTheColourOfThePaneOrNone) {
  make(0.02F);
  const auto found = tints();
  for (std::uint32_t leaf = 0; leaf < 256; ++leaf) {
    if (std::abs(across(leaf)) < 0.07F) continue;
    const auto truth = across(leaf) < 0.0F ? kTint : glm::vec3(1.0F);
    for (std::size_t half = 0; half < 2; ++half)
      EXPECT_LT(glm::distance(at(*found, leaf, half), truth), 1e-4F) << across(leaf);
  }
}

// In the mean of two leaves as far on either side of the edge half of the lamp is seen through the pane, of whose light
// three fifths pass, and half of it beside.
TEST_F(HalfBehindGlass, LeavesThatSeeALampInTwoColoursHaveTheirMean) {
  make(0.9F);
  const auto found = tints(32.0);
  const auto mean = (kPasses * kTint + 1.0F) / (kPasses + 1.0F);
  for (std::size_t half = 0; half < 2; ++half) {
    glm::vec3 left(0.0F), right(0.0F);
    for (std::uint32_t leaf = 0; leaf < 256; ++leaf) {
      if (std::abs(across(leaf)) > 0.04F) continue;
      (across(leaf) < 0.0F ? left : right) += at(*found, leaf, half) / 16.0F;
    }
    EXPECT_LT(left.y, right.y);
    EXPECT_LT(glm::distance(0.5F * (left + right), mean), 0.01F)
        << "512 looks of 32 leaves, each part by its own weight";
  }
}

TEST_F(HalfBehindGlass, HalvesAreIndependentAndCutsChangeNothing) {
  make(0.9F);
  const auto at_once = tints(), in_slices = tints(1.0, 0.0);
  bool differ = false;
  for (std::uint32_t leaf = 0; leaf < 256; ++leaf) {
    for (std::size_t half = 0; half < 2; ++half) EXPECT_EQ(at(*at_once, leaf, half), at(*in_slices, leaf, half));
    differ = differ || at(*at_once, leaf, 0) != at(*at_once, leaf, 1);
  }
  EXPECT_TRUE(differ);
}

TEST_F(HalfBehindGlass, NeighboursShareAColourWhereThereIsNoRoom) {
  make(0.9F);
  const auto found = tints(1.0, 1e6, 2 * LinkTint::kRunBytes * 80);  // of 256 pairs and more: every fourth, or fewer
  for (std::uint32_t leaf = 0; leaf < 256; leaf += 4) {
    for (std::uint32_t k = 1; k < 4; ++k) EXPECT_EQ(at(*found, leaf, 0), at(*found, leaf + k, 0));
  }
  EXPECT_NE(at(*found, 0, 0), at(*found, 15 * 16, 0));
}

TEST_F(HalfBehindGlass, WhatIsKnownOfALampStaysKnown) {
  make(0.9F);
  const auto found = tints();
  const auto before = found->tint(0, 0);
  auto other = lamp_;
  other.key += 2;
  for (auto& corner : other.corners) corner.x += 0.05F;
  found->begin({LightTints::of(other), LightTints::of(lamp_)}, rays_);
  while (!found->advance(1.0)) continue;
  EXPECT_EQ(found->tint(1, 0), before);
  EXPECT_NE(found->tint(0, 0), before);
}

TEST_F(HalfBehindGlass, NothingIsLookedForWhereNothingIsColoured) {
  make(0.9F);
  patches_->surfaces[2].first_tint = scene::kNone;
  EXPECT_FALSE(LightTints(*patches_, sides_, 1, 1U << 20U).isNeeded());
}

TEST(LinkTint, KnowsWhichLeavesAreColoured) {
  LinkTint tint;
  tint.add(3, 2, glm::vec3(0.5F));
  tint.add(5, 1, glm::vec3(0.5F));
  tint.add(6, 2, glm::vec3(1.0F));
  tint.add(9, 1, kTint);
  EXPECT_EQ(tint.bytes(), 2 * LinkTint::kRunBytes) << "runs of one colour are one";
  std::array<std::vector<float>, 3> light;
  for (auto& plane : light) plane.assign(12, 2.0F);
  tint.apply({light[0].data(), light[1].data(), light[2].data()});
  for (std::uint32_t leaf = 0; leaf < 12; ++leaf) {
    const auto truth = leaf >= 3 && leaf < 6 ? glm::vec3(0.5F) : leaf == 9 ? kTint : glm::vec3(1.0F);
    EXPECT_EQ(tint.at(leaf), truth) << leaf;
    EXPECT_EQ(glm::vec3(light[0][leaf], light[1][leaf], light[2][leaf]), 2.0F * truth) << leaf;
  }
}

TEST(PaneStep, IsNeitherALeafNorAMirror) {
  const PaneStep step{123'456'789};
  EXPECT_TRUE(PaneStep::is(step.code()));
  EXPECT_FALSE(SpecularStep::is(step.code()));
  EXPECT_EQ(PaneStep::of(step.code()).tint, 123'456'789U);
  EXPECT_FALSE(PaneStep::is(1'000'000'000));
  EXPECT_FALSE(PaneStep::is(SpecularStep{12'345'678, 15, true}.code()));
}

}  // namespace
}  // namespace radiosity::solver
