// What leaves get of images of lamps, and how long it is known.
#include "server/solver/reflected/imaged_light.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

/// A cube with a mirror for a wall, and a lamp in it.
class ImagedLightTest : public testing::Test {
 protected:
  ImagedLightTest()
      : made_(test::makeQuadScene(test::cubeQuads(32, test::kDark, test::kGrey))),
        sides_(makeSides(*made_.patches)),
        rays_(std::make_shared<const LeafRays>(*made_.patches, sides_)) {
    polish(glm::vec3(0.5F));
  }

  void polish(const glm::vec3& colour) {
    made_.materials.specular = made_.materials.lobe = scene::SideColours(*made_.patches);
    made_.materials.specular.fill(sides_[1].number, colour);
    made_.materials.lobe.fill(sides_[1].number, glm::vec3(0.0F, 0.5F, 0.0F));
  }

  [[nodiscard]] ImagedLight::Lamps lamps(float intensity, float height = 0.1F) const {
    PunctualLights::Source source;
    source.position = {0.1F, height, -0.2F};
    source.intensity = glm::dvec3(static_cast<double>(intensity));
    const std::vector<PunctualLights::Source> sources{source};
    const auto mirrors = SpecularLeaves::find(sides_, made_.materials, made_.patches->surfaces);
    return {LampImages::find(*made_.patches, sides_, rays_, mirrors, {}, sources), LampImages::lightOf({}, sources)};
  }

  [[nodiscard]] ImagedLight make(std::size_t most_bytes = std::size_t{1} << 30) const {
    return {sides_, rays_, 1, most_bytes};
  }
  [[nodiscard]] static std::vector<glm::vec3> lightOf(const ImagedLight& imaged, std::size_t leaves) {
    std::vector<glm::vec3> light(leaves, glm::vec3(0.0F));
    imaged.addTo(0, light);
    return light;
  }
  [[nodiscard]] std::size_t leafCount() const { return sides_.back().first_value + sides_.back().leaf_count; }

  test::QuadScene made_;
  std::vector<Side> sides_;
  std::shared_ptr<const LeafRays> rays_;
};

TEST_F(ImagedLightTest, IsTheSameHoweverItIsCut) {
  auto at_once = make(), in_slices = make();
  at_once.begin(lamps(1.0F), nullptr);
  ASSERT_TRUE(at_once.advance(HUGE_VAL));
  in_slices.begin(lamps(1.0F), nullptr);
  while (!in_slices.advance(0.0)) continue;
  const auto light = lightOf(at_once, leafCount());
  EXPECT_EQ(light, lightOf(in_slices, leafCount()));
  EXPECT_GT(std::ranges::count_if(light, [](const glm::vec3& l) { return l.x > 0.0F; }), 4000) << "five walls";
}

TEST_F(ImagedLightTest, OfOtherLightOrOfALampThatComesBackAsksNoRayAgain) {
  auto imaged = make();
  EXPECT_GT(imaged.looksFor(lamps(1.0F)), 0U);
  imaged.begin(lamps(1.0F), nullptr);
  EXPECT_TRUE(imaged.isBehind());
  ASSERT_TRUE(imaged.advance(HUGE_VAL));
  const auto light = lightOf(imaged, leafCount());
  EXPECT_EQ(imaged.looksFor(lamps(4.0F)), 0U);
  imaged.begin(lamps(4.0F), nullptr);
  EXPECT_FALSE(imaged.isBehind());
  const auto brighter = lightOf(imaged, leafCount());
  for (std::size_t v = 0; v < light.size(); ++v) ASSERT_EQ(brighter[v], 4.0F * light[v]);
  imaged.begin({}, nullptr);
  EXPECT_EQ(lightOf(imaged, leafCount()), std::vector<glm::vec3>(leafCount(), glm::vec3(0.0F)));
  EXPECT_EQ(imaged.looksFor(lamps(1.0F)), 0U) << "the lamp is switched on again";
  EXPECT_GT(imaged.looksFor(lamps(1.0F, 0.2F)), 0U) << "it hangs elsewhere";
  polish(glm::vec3(0.4F));
  EXPECT_GT(imaged.looksFor(lamps(1.0F)), 0U) << "the mirror is another";
}

TEST_F(ImagedLightTest, LooksMoreOftenWhenItIsRefined) {
  auto imaged = make();
  EXPECT_FALSE(imaged.refine(2.0)) << "there is nothing to look at";
  imaged.begin(lamps(1.0F), nullptr);
  ASSERT_TRUE(imaged.advance(HUGE_VAL));
  EXPECT_TRUE(imaged.refine(100.0));
  EXPECT_EQ(imaged.times(), 4U) << "step by step";
  EXPECT_TRUE(imaged.isBehind());
  imaged.begin(lamps(1.0F), nullptr);
  ASSERT_TRUE(imaged.advance(HUGE_VAL));
  EXPECT_FALSE(imaged.isBehind());
  while (imaged.refine(4.0)) continue;
  EXPECT_EQ(imaged.times(), ImagedLight::kMostTimes);
}

TEST_F(ImagedLightTest, IsGivenUpForGoodWhereThereIsNoRoom) {
  auto imaged = make(1000);
  imaged.begin(lamps(1.0F), nullptr);
  while (!imaged.advance(HUGE_VAL)) continue;
  EXPECT_TRUE(imaged.isGivenUp());
  EXPECT_EQ(imaged.images(), nullptr);
  imaged.begin(lamps(1.0F), nullptr);
  EXPECT_TRUE(imaged.advance(HUGE_VAL));
  EXPECT_EQ(imaged.images(), nullptr);
  EXPECT_FALSE(imaged.isBehind());
}

}  // namespace
}  // namespace radiosity::solver
