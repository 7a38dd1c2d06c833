// What lamps send to leaves by way of mirrors, against the light of their images, and how long it is known.
#include "server/solver/reflected/caustic_light.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <vector>

#include "server/solver/math/polygon_form_factor.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

constexpr float kReflects = 0.5F;

/// A cube with a mirror for a wall, and a lamp in it that hides nothing.
class CausticLightTest : public testing::Test {
 protected:
  CausticLightTest()
      : made_(test::makeQuadScene(test::cubeQuads(8, test::kDark, test::kGrey))),
        sides_(makeSides(*made_.patches)),
        rays_(std::make_shared<const LeafRays>(*made_.patches, sides_)) {
    polish(1, kReflects);
  }

  void polish(std::size_t side, float reflects) {
    made_.materials.specular = made_.materials.lobe = scene::SideColours(*made_.patches);
    made_.materials.specular.fill(sides_[side].number, glm::vec3(reflects));
    made_.materials.lobe.fill(sides_[side].number, glm::vec3(0.0F, reflects, 0.0F));
  }

  /// Where the mirror is, and towards the inside.
  [[nodiscard]] LeafRays::Place mirror() const { return rays_->placeOn(sides_[1].first_value, {0.5, 0.5}); }
  [[nodiscard]] static glm::vec3 mirrored(const glm::vec3& point, const LeafRays::Place& mirror) {
    const glm::dvec3 at(point);
    return glm::vec3(at - 2.0 * glm::dot(at - mirror.position, mirror.normal) * mirror.normal);
  }

  /// A square that faces the mirror, at so much of the way from it to the wall opposite.
  [[nodiscard]] LightPolygon lampAt(double away, std::uint32_t key = 2, float emission = 1.0F) const {
    const auto [position, normal, value, triangle] = mirror();
    const auto middle = -0.5 * normal + away * normal;
    const glm::dvec3 up = std::abs(normal.y) < 0.5 ? glm::dvec3(0, 1, 0) : glm::dvec3(1, 0, 0);
    const auto along = glm::cross(up, -normal);
    LightPolygon lamp;
    constexpr double kHalf = 0.1;
    lamp.corners = {glm::vec3(middle - kHalf * along - kHalf * up), glm::vec3(middle + kHalf * along - kHalf * up),
                    glm::vec3(middle + kHalf * along + kHalf * up), glm::vec3(middle - kHalf * along + kHalf * up)};
    lamp.corner_count = 4;
    lamp.normal = glm::vec3(-normal);
    lamp.emission = glm::vec3(emission);
    lamp.area = 4.0 * kHalf * kHalf;
    lamp.key = key;
    return lamp;
  }

  [[nodiscard]] CausticLight::Lamps lamps(const std::vector<LightPolygon>& of) const {
    const auto mirrors = SpecularLeaves::find(sides_, made_.materials, made_.patches->surfaces);
    CausticLight::Lamps lamps{CausticPaths::find(sides_, rays_, mirrors, of), {}};
    for (const auto& lamp : of) lamps.light.push_back(lamp.emission);
    return lamps;
  }

  [[nodiscard]] CausticLight make(std::size_t most_bytes = std::size_t{1} << 30U) const {
    return {rays_, 1, most_bytes};
  }
  void begin(CausticLight& caustics, CausticLight::Lamps lamps) const {
    caustics.begin(std::move(lamps), nullptr, leafCount());
  }
  [[nodiscard]] std::vector<glm::vec3> lightOf(const CausticLight& caustics, std::size_t half = 0) const {
    std::vector<glm::vec3> light(leafCount(), glm::vec3(0.0F));
    caustics.addTo(half, light);
    return light;
  }
  [[nodiscard]] std::uint32_t leafCount() const { return sides_.back().first_value + sides_.back().leaf_count; }

  /// Of all light the part that is wrong, RMS over leaves, and in the mean.
  struct Off {
    double rms = 0.0, mean = 0.0;
  };
  /// Every leaf sees the whole image of the lamp in the wall. `of_lamp`: the lamp, or another one that is to be found.
  [[nodiscard]] Off offFromImage(const std::vector<glm::vec3>& light, LightPolygon lamp) const {
    for (std::uint32_t i = 0; i < lamp.corner_count; ++i) lamp.corners[i] = mirrored(lamp.corners[i], mirror());
    std::reverse(lamp.corners.begin(), lamp.corners.end());
    constexpr int kGrid = 6;  // the light bends next to a lamp
    double square = 0.0, all = 0.0, sum = 0.0, exact = 0.0;
    for (std::uint32_t v = 0; v < light.size(); ++v) {
      double expected = 0.0;
      if (rays_->indexOfSide(v) != 1) {
        for (int i = 0; i < kGrid * kGrid; ++i) {
          const auto place = rays_->placeOn(v, {(i % kGrid + 0.5) / kGrid, (i / kGrid + 0.5) / kGrid});
          expected += static_cast<double>(kReflects) * polygonFormFactor(place.position, place.normal, lamp.corners) /
                      (kGrid * kGrid);
        }
      }
      const auto found = static_cast<double>(light[v].y);
      square += (found - expected) * (found - expected);
      all += expected * expected;
      sum += found;
      exact += expected;
    }
    return {std::sqrt(square / all), std::abs(sum / exact - 1.0)};
  }

  test::QuadScene made_;
  std::vector<Side> sides_;
  std::shared_ptr<const LeafRays> rays_;
};

// Of 4096 paths over the 320 leaves of five walls 28 per cent were chance alone, and draws are spread better.
TEST_F(CausticLightTest, BringsWhatALampBehindTheMirrorWould) {
  const auto lamp = lampAt(0.6);
  auto caustics = make();
  begin(caustics, lamps({lamp}));
  ASSERT_TRUE(caustics.advance(HUGE_VAL));
  for (std::size_t half = 0; half < 2; ++half) {
    const auto off = offFromImage(lightOf(caustics, half), lamp);
    EXPECT_LT(off.rms, 0.28);
    EXPECT_LT(off.mean, 0.01);
  }
  EXPECT_NE(lightOf(caustics, 0), lightOf(caustics, 1));
  const auto before = offFromImage(lightOf(caustics), lamp);
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(caustics.refine(4.0));
  ASSERT_TRUE(caustics.advance(HUGE_VAL));
  const auto after = offFromImage(lightOf(caustics), lamp);
  EXPECT_LT(after.rms, 0.3 * before.rms);  // of sixteen times as many: 0.25
  EXPECT_LT(after.mean, 0.003);
}

// Next to the mirror a few of its leaves get all of the light, and towards their places it changes without bounds.
TEST_F(CausticLightTest, NoPathOfALampNextToTheMirrorBringsMuchMoreThanOthers) {
  const auto far = lampAt(0.6), near = lampAt(0.004);
  auto of_far = make(), of_near = make();
  begin(of_far, lamps({far}));
  begin(of_near, lamps({near}));
  ASSERT_TRUE(of_far.advance(HUGE_VAL));
  ASSERT_TRUE(of_near.advance(HUGE_VAL));
  const auto off = offFromImage(lightOf(of_near), near);
  EXPECT_LT(off.mean, 0.02);
  EXPECT_LT(off.rms, 3.0 * offFromImage(lightOf(of_far), far).rms);
}

TEST_F(CausticLightTest, IsTheSameHoweverItIsCut) {
  auto at_once = make(), in_slices = make();
  for (auto* caustics : {&at_once, &in_slices}) caustics->setTimes(16);  // so many that a lamp's are cut
  const std::vector<LightPolygon> two{lampAt(0.6, 2), lampAt(0.3, 4)};
  begin(at_once, lamps(two));
  ASSERT_TRUE(at_once.advance(HUGE_VAL));
  begin(in_slices, lamps(two));
  while (!in_slices.advance(0.0)) continue;
  const auto light = lightOf(at_once);
  EXPECT_EQ(light, lightOf(in_slices));
  EXPECT_GT(std::ranges::count_if(light, [](const glm::vec3& l) { return l.x > 0.0F; }), 310) << "five walls";
}

TEST_F(CausticLightTest, OfOtherLightOrOfALampThatComesBackFollowsNoPathAgain) {
  auto caustics = make();
  EXPECT_GT(caustics.raysFor(lamps({lampAt(0.6)}), leafCount()), 0U);
  begin(caustics, lamps({lampAt(0.6)}));
  EXPECT_TRUE(caustics.isBehind());
  ASSERT_TRUE(caustics.advance(HUGE_VAL));
  const auto light = lightOf(caustics);
  EXPECT_EQ(caustics.raysFor(lamps({lampAt(0.6, 2, 4.0F)}), leafCount()), 0U);
  begin(caustics, lamps({lampAt(0.6, 2, 4.0F)}));
  EXPECT_FALSE(caustics.isBehind());
  const auto brighter = lightOf(caustics);
  for (std::size_t v = 0; v < light.size(); ++v) ASSERT_EQ(brighter[v], 4.0F * light[v]);
  begin(caustics, {});
  EXPECT_EQ(lightOf(caustics), std::vector<glm::vec3>(leafCount(), glm::vec3(0.0F)));
  EXPECT_EQ(caustics.raysFor(lamps({lampAt(0.6)}), leafCount()), 0U) << "the lamp is switched on again";
  begin(caustics, lamps({lampAt(0.6)}));
  EXPECT_EQ(lightOf(caustics), light);
  EXPECT_GT(caustics.raysFor(lamps({lampAt(0.6, 4)}), leafCount()), 0U) << "another hangs there";
  polish(1, 0.4F);
  EXPECT_GT(caustics.raysFor(lamps({lampAt(0.6)}), leafCount()), 0U) << "the mirror is another";
}

// However many others there are meanwhile: each is worth a part of what one by itself would be.
TEST_F(CausticLightTest, ALampAmongOthersIsTheSameWhenTheseComeBack) {
  constexpr std::uint32_t kLeaves = 16384;  // of so many two lamps share the paths
  const std::vector<LightPolygon> two{lampAt(0.6, 2), lampAt(0.3, 4)}, one{two[0]};
  auto caustics = make();
  caustics.begin(lamps(two), nullptr, kLeaves);
  ASSERT_TRUE(caustics.advance(HUGE_VAL));
  const auto light = lightOf(caustics);
  EXPECT_NE(make().raysFor(lamps(one), kLeaves), make().raysFor(lamps(two), kLeaves) / 2) << "they share";
  caustics.begin(lamps(one), nullptr, kLeaves);
  EXPECT_FALSE(caustics.isBehind());
  caustics.begin(lamps(two), nullptr, kLeaves);
  EXPECT_FALSE(caustics.isBehind());
  EXPECT_EQ(lightOf(caustics), light);
}

TEST_F(CausticLightTest, FollowsMorePathsWhenItIsRefined) {
  auto caustics = make();
  EXPECT_FALSE(caustics.refine(2.0)) << "there is no lamp";
  begin(caustics, lamps({lampAt(0.6)}));
  ASSERT_TRUE(caustics.advance(HUGE_VAL));
  EXPECT_TRUE(caustics.refine(100.0));
  EXPECT_EQ(caustics.times(), 4U) << "step by step";
  EXPECT_TRUE(caustics.isBehind());
  ASSERT_TRUE(caustics.advance(HUGE_VAL));
  EXPECT_FALSE(caustics.isBehind());
  while (caustics.refine(4.0)) continue;
  EXPECT_EQ(caustics.times(), CausticLight::kMostTimes);
}

TEST_F(CausticLightTest, IsGivenUpForGoodWhereThereIsNoRoom) {
  auto caustics = make(1000);
  begin(caustics, lamps({lampAt(0.6)}));
  while (!caustics.advance(HUGE_VAL)) continue;
  EXPECT_TRUE(caustics.isGivenUp());
  EXPECT_EQ(caustics.paths(), nullptr);
  begin(caustics, lamps({lampAt(0.6)}));
  EXPECT_TRUE(caustics.advance(HUGE_VAL));
  EXPECT_FALSE(caustics.isBehind());
}

TEST_F(CausticLightTest, WithoutMirrorsOrLampsThereAreNoPaths) {
  EXPECT_EQ(lamps({}).paths, nullptr);
  made_.materials.specular = made_.materials.lobe = scene::SideColours(*made_.patches);
  EXPECT_EQ(lamps({lampAt(0.6)}).paths, nullptr);
}

}  // namespace
}  // namespace radiosity::solver
