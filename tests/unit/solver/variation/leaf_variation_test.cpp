// What a leaf's uneven light does to what sees a part of it, against integrals.
#include "server/solver/variation/leaf_variation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/solver/math/polygon_form_factor.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

constexpr double kReflectance = 0.8;
constexpr int kGrid = 60;  // points along each side of an integral

/// Form factor density between two small patches that see each other.
double kernel(const glm::dvec3& from, const glm::dvec3& normal, const glm::dvec3& to, const glm::dvec3& to_normal) {
  const glm::dvec3 way = to - from;
  const double square = glm::dot(way, way), here = glm::dot(way, normal), there = -glm::dot(way, to_normal);
  return here > 0.0 && there > 0.0 ? here * there / (std::numbers::pi * square * square) : 0.0;
}

double middle(int i) { return (i + 0.5) / kGrid; }

glm::vec3 correctionOf(const LeafVariation& variation, std::size_t half, std::uint32_t value) {
  for (const auto& correction : variation.corrections())
    if (correction.value == value) return correction.lacks[half];
  return glm::vec3(0.0F);
}

/// A floor of one leaf, and on its edge a wall: below, a strip that shines, above it one that looks.
class LeafVariationTest : public testing::Test {
 protected:
  static constexpr double kWidth = 0.2, kHeight = 0.02;
  static constexpr std::uint32_t kLooks = 8;  // leaves of the strip that looks

  LeafVariationTest() {
    test::Quad floor{{0.0F, 0.0F, 0.0F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.2F, 0.0F}};
    floor.reflectance = glm::vec3(static_cast<float>(kReflectance));
    test::Quad looks{{0.0F, 0.0F, 0.02F}, {0.0F, 0.2F, 0.0F}, {0.0F, 0.0F, 0.02F}};
    floor.width = floor.height = looks.height = 1;
    looks.width = kLooks;
    scene_ = test::makeQuadScene({floor, looks});
    sides_ = makeSides(*scene_.patches);
    LightPolygon lamp;
    lamp.corners = {glm::vec3(0.0F, 0.0F, 0.0F), {0.0F, 0.2F, 0.0F}, {0.0F, 0.2F, 0.02F}, {0.0F, 0.0F, 0.02F}};
    lamp.corner_count = 4;
    lamp.normal = {1.0F, 0.0F, 0.0F};
    lamp.emission = glm::vec3(1.0F);
    lamp.area = kWidth * kHeight;
    lamps_.push_back(lamp);
    emission_.assign(1 + kLooks, glm::vec3(0.0F));
    reflectance_ = emission_;
    reflectance_[0] = floor.reflectance;
    irradiance_ = emission_;
  }

  [[nodiscard]] LeafLight light() const { return {emission_, reflectance_, {irradiance_, irradiance_}, lamps_, {}}; }

  /// Irradiance of the floor there by the lamp: Lambert's formula, which other tests hold against closed forms.
  [[nodiscard]] double litAt(const glm::dvec3& at) const {
    return polygonFormFactor(at, {0, 0, 1}, std::span(lamps_[0].corners.data(), 4));
  }

  /// What the strip above gets over the floor, less what it would get were the floor's light even.
  [[nodiscard]] double lacking() const {
    std::vector<double> lit;
    std::vector<glm::dvec3> at;
    double mean = 0.0;
    for (int x = 0; x < kGrid; ++x) {
      for (int y = 0; y < kGrid; ++y) {
        const double u = middle(x);  // points lie closer towards the wall, where all happens
        at.emplace_back(u * u * u * kWidth, middle(y) * kWidth, 0.0);
        lit.push_back(litAt(at.back()));
        mean += 3.0 * u * u * lit.back() / (kGrid * kGrid);
      }
    }
    double sum = 0.0;
    constexpr int kReceiver = 10;
    for (int y = 0; y < kReceiver; ++y) {
      for (int z = 0; z < kReceiver; ++z) {
        const glm::dvec3 from(0.0, (y + 0.5) / kReceiver * kWidth, kHeight + (z + 0.5) / kReceiver * kHeight);
        for (std::size_t i = 0; i < at.size(); ++i) {
          const double u = middle(static_cast<int>(i) / kGrid);
          sum += kernel(from, {1, 0, 0}, at[i], {0, 0, 1}) * (lit[i] - mean) * 3.0 * u * u;
        }
      }
    }
    return kReflectance * sum * kWidth * kWidth / (kGrid * kGrid) / (kReceiver * kReceiver);
  }

  test::QuadScene scene_;
  std::vector<Side> sides_;
  std::vector<LightPolygon> lamps_;
  std::vector<glm::vec3> emission_, reflectance_, irradiance_;
};

TEST_F(LeafVariationTest, LightBesideALampsRimIsFoundAndCorrected) {
  LeafVariation variation(*scene_.patches, sides_, 1);
  variation.update(light(), 0.0);
  for (int round = 0; round < 12 && variation.refine(); ++round) variation.update(light(), 0.0);
  ASSERT_TRUE(variation.corrects());
  const double expected = lacking();
  EXPECT_GT(expected, 0.01);  // it gets a part more than by even light
  double found = 0.0;
  for (std::size_t half = 0; half < 2; ++half) {
    for (std::uint32_t leaf = 0; leaf < kLooks; ++leaf)
      found += 0.5 * static_cast<double>(correctionOf(variation, half, sides_[1].first_value + leaf).x) / kLooks;
    EXPECT_EQ(correctionOf(variation, half, sides_[0].first_value), glm::vec3(0.0F));  // the floor sees no other leaf
  }
  // Thousands of paths: noise() says how well each leaf is known. The integral is good to a percent.
  const double sigma = std::sqrt(variation.noise() / (3.0 * kWidth * kHeight) / kLooks);
  EXPECT_LT(sigma, 0.05 * expected);
  EXPECT_NEAR(found, expected, 3.0 * sigma + 0.01 * expected);
  EXPECT_LT(variation.left(), 0.1 * 3.0 * kWidth * kHeight * expected * expected);
}

// The lamp reaches as far below the floor as above it: what lies below adds nothing, and takes nothing away.
TEST_F(LeafVariationTest, OfALampThatTheFloorsPlaneCutsTheUpperPartCounts) {
  lamps_[0].corners[0].z = lamps_[0].corners[1].z = -static_cast<float>(kHeight);
  lamps_[0].area *= 2.0;
  LeafVariation variation(*scene_.patches, sides_, 1);
  variation.update(light(), 0.0);
  for (int round = 0; round < 12 && variation.refine(); ++round) variation.update(light(), 0.0);
  ASSERT_TRUE(variation.corrects());
  double found = 0.0;
  for (std::size_t half = 0; half < 2; ++half)
    for (std::uint32_t leaf = 0; leaf < kLooks; ++leaf)
      found += 0.5 * static_cast<double>(correctionOf(variation, half, sides_[1].first_value + leaf).x) / kLooks;
  const double expected = lacking(), sigma = std::sqrt(variation.noise() / (3.0 * kWidth * kHeight) / kLooks);
  EXPECT_LT(sigma, 0.08 * expected);
  EXPECT_NEAR(found, expected, 3.0 * sigma + 0.01 * expected);  // half of it where the cut counted twice
}

TEST_F(LeafVariationTest, WhatIsBelowTheBoundIsStatedAndNotCorrected) {
  LeafVariation variation(*scene_.patches, sides_, 1);
  variation.update(light(), 1.0);
  EXPECT_FALSE(variation.corrects());
  EXPECT_FALSE(variation.refine());
  EXPECT_EQ(variation.noise(), 0.0);
}

TEST_F(LeafVariationTest, TheSamePathsFollowOtherLight) {
  LeafVariation variation(*scene_.patches, sides_, 1);
  variation.update(light(), 0.0);
  for (int round = 0; round < 6 && variation.refine(); ++round) variation.update(light(), 0.0);
  ASSERT_TRUE(variation.corrects());
  const auto looks = sides_[1].first_value + 3;
  const std::array<glm::vec3, 2> before{correctionOf(variation, 0, looks), correctionOf(variation, 1, looks)};
  lamps_[0].emission = glm::vec3(4.0F, 2.0F, 0.5F);
  variation.update(light(), 0.0);
  for (std::size_t half = 0; half < 2; ++half) {
    EXPECT_NEAR(correctionOf(variation, half, looks).x, 4.0F * before[half].x, 1e-5F * before[half].x);
    EXPECT_NEAR(correctionOf(variation, half, looks).z, 0.5F * before[half].z, 1e-5F * before[half].z);
  }
  lamps_[0].emission = glm::vec3(0.0F);
  variation.update(light(), 0.0);
  EXPECT_EQ(variation.left(), 0.0);
  lamps_[0].emission = glm::vec3(1.0F);
  variation.update(light(), 0.0);
  for (std::size_t half = 0; half < 2; ++half) EXPECT_EQ(correctionOf(variation, half, looks), before[half]);
}

// What paths had of a lamp is kept while it is off; those that were added meanwhile know nothing of it.
TEST_F(LeafVariationTest, PathsThatWereAddedWhileALampWasOffSeeItWhenItIsOnAgain) {
  lamps_.push_back(lamps_[0]);
  lamps_[1].key = 2;
  for (auto& corner : lamps_[1].corners) corner.z *= 0.5F;
  LeafVariation variation(*scene_.patches, sides_, 1);
  variation.update(light(), 0.0);
  lamps_[1].emission = glm::vec3(0.0F);
  variation.update(light(), 0.0);
  int added = 0;
  for (; added < 3 && variation.refine(); ++added) variation.update(light(), 0.0);
  ASSERT_EQ(added, 3);
  lamps_[1].emission = glm::vec3(1.0F);
  variation.update(light(), 0.0);
  std::vector<std::uint32_t> same(1 + kLooks);
  for (std::uint32_t value = 0; value < same.size(); ++value) same[value] = value;
  LeafVariation anew(*scene_.patches, sides_, 1);
  anew.inherit(variation, same, std::vector(same.size(), LeafVariation::Tells::kNothing));
  anew.update(light(), 0.0);
  ASSERT_TRUE(anew.corrects());
  for (std::size_t half = 0; half < 2; ++half) {
    for (const auto value : same) EXPECT_EQ(correctionOf(variation, half, value), correctionOf(anew, half, value));
  }
}

TEST_F(LeafVariationTest, AfterAnEditWhatIsClearOfItKeepsWhatItsPathsFound) {
  LeafVariation former(*scene_.patches, sides_, 1);
  former.update(light(), 0.0);
  for (int round = 0; round < 3 && former.refine(); ++round) former.update(light(), 0.0);
  ASSERT_TRUE(former.corrects());
  std::vector<std::uint32_t> same(1 + kLooks);
  for (std::uint32_t value = 0; value < same.size(); ++value) same[value] = value;
  for (const bool clear : {true, false}) {
    LeafVariation next(*scene_.patches, sides_, 1);
    next.inherit(former, same,
                 std::vector(same.size(), clear ? LeafVariation::Tells::kAll : LeafVariation::Tells::kNothing));
    next.update(light(), 0.0);
    EXPECT_EQ(next.left(), former.left());
    EXPECT_EQ(next.noise(), former.noise());
    for (std::size_t half = 0; half < 2; ++half) {
      for (const auto value : same) EXPECT_EQ(correctionOf(next, half, value), correctionOf(former, half, value));
    }
  }
  // The same strip far above the floor: nothing is near. Only where it is said to be clear is that not asked again.
  test::Quad floor{{0.0F, 0.0F, 0.0F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.2F, 0.0F}};
  test::Quad looks{{0.0F, 0.0F, 0.9F}, {0.0F, 0.2F, 0.0F}, {0.0F, 0.0F, 0.02F}};
  floor.width = floor.height = looks.height = 1;
  looks.width = kLooks;
  const auto far = test::makeQuadScene({floor, looks});
  LeafVariation alone(*far.patches, sides_, 1);
  alone.update(light(), 0.0);
  ASSERT_FALSE(alone.corrects());
  for (const bool clear : {true, false}) {
    LeafVariation next(*scene_.patches, sides_, 1);
    next.inherit(alone, same,
                 std::vector(same.size(), clear ? LeafVariation::Tells::kAll : LeafVariation::Tells::kNothing));
    next.update(light(), 0.0);
    EXPECT_EQ(next.corrects(), !clear);
  }
}

// What is stated of corrections by a few paths, against those by thousands, which are the truth beside them.
TEST_F(LeafVariationTest, WhatIsStatedOfCorrectionsIsWhatTheyAreOffBy) {
  LeafVariation exact(*scene_.patches, sides_, 1000);
  exact.update(light(), 0.0);
  for (int round = 0; round < 14 && exact.refine(); ++round) exact.update(light(), 0.0);
  const auto mean = [&](const LeafVariation& of, std::uint32_t leaf) {
    const auto value = sides_[1].first_value + leaf;
    return 0.5 * static_cast<double>(correctionOf(of, 0, value).x + correctionOf(of, 1, value).x);
  };
  const double area = kWidth * kHeight / kLooks;
  for (const int rounds : {0, 3}) {
    double stated = 0.0, off = 0.0;
    int count = 0;
    for (std::uint64_t seed = 1; seed <= 400; ++seed) {
      LeafVariation variation(*scene_.patches, sides_, seed);
      variation.update(light(), 0.0);
      for (int round = 0; round < rounds && variation.refine(); ++round) variation.update(light(), 0.0);
      if (!variation.corrects()) continue;
      ++count;
      stated += variation.left() + variation.noise();
      for (std::uint32_t leaf = 0; leaf < kLooks; ++leaf) {
        const double difference = mean(variation, leaf) - mean(exact, leaf);
        off += 3.0 * area * difference * difference;
      }
    }
    EXPECT_GT(count, 300);
    // Four hundred seeds tell it to some percent. Refinement goes where noise seems large, and leaves it where it seems
    // small by chance: an eighth too little is stated then (a tenth where a leaf's own noise counts for nothing).
    const double ratio = std::sqrt(stated / off);
    EXPECT_GT(ratio, rounds == 0 ? 0.95 : 0.85);
    EXPECT_LT(ratio, 1.05);
  }
}

// A wall far off, of which a small part is very bright: few paths see that, and each of them would be a blotch.
TEST_F(LeafVariationTest, WhatOnePathFindsByChanceIsNoCorrection) {
  test::Quad floor{{0.0F, 0.0F, 0.0F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.2F, 0.0F}};
  floor.reflectance = glm::vec3(static_cast<float>(kReflectance));
  test::Quad looks{{0.0F, 0.0F, 0.02F}, {0.0F, 0.2F, 0.0F}, {0.0F, 0.0F, 0.02F}};
  test::Quad spark{{0.9F, 0.12F, 0.3F}, {0.0F, -0.04F, 0.0F}, {0.0F, 0.0F, 0.04F}};
  floor.width = floor.height = looks.height = spark.width = spark.height = 1;
  looks.width = kLooks;
  const auto scene = test::makeQuadScene({floor, looks, spark});
  const auto sides = makeSides(*scene.patches);
  emission_.emplace_back(400.0F);
  reflectance_.emplace_back(0.0F);
  irradiance_.emplace_back(0.0F);
  // In the mean it adds less than the lamp beside the floor does. One path that sees it brings twenty times as much and
  // more, where its neighbours' noise alone is weighed.
  const double most = 4.0 * lacking();
  int corrected = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    LeafVariation variation(*scene.patches, sides, seed);
    variation.update(light(), 0.0);
    for (int round = 0; round < 4 && variation.refine(); ++round) variation.update(light(), 0.0);
    if (!variation.corrects()) continue;
    ++corrected;
    for (std::uint32_t leaf = 0; leaf < kLooks; ++leaf) {
      const auto value = sides[1].first_value + leaf;
      const double mean =
          0.5 * static_cast<double>(correctionOf(variation, 0, value).x + correctionOf(variation, 1, value).x);
      EXPECT_LT(std::abs(mean), most) << "leaf " << leaf << ", seed " << seed;
    }
  }
  EXPECT_GT(corrected, 30);
}

// The furnace: every place sees the same radiosity whichever way it looks.
TEST(LeafVariation, EvenLightLeavesNothing) {
  const auto scene = test::makeQuadScene(test::cubeQuads(4, {1, 1, 1, 1, 1, 1}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F}));
  const auto sides = makeSides(*scene.patches);
  const std::size_t values = sides.back().first_value + sides.back().leaf_count;
  const std::vector<glm::vec3> emission(values, glm::vec3(1.0F)), reflectance(values, glm::vec3(0.5F)),
      irradiance(values, glm::vec3(2.0F));
  LeafVariation variation(*scene.patches, sides, 1);
  variation.update({emission, reflectance, {irradiance, irradiance}, {}, {}}, 0.0);
  EXPECT_EQ(variation.left(), 0.0);
  EXPECT_EQ(variation.noise(), 0.0);
  EXPECT_FALSE(variation.corrects());
}

/// A cube with a lamp at its top that lights a wall as it might a cornice.
struct LitCube {
  test::QuadScene scene = test::makeQuadScene(test::cubeQuads(30, {0, 0, 0, 0, 0, 0}, test::kGrey));
  std::vector<Side> sides = makeSides(*scene.patches);
  std::vector<LightPolygon> lamps{1};
  std::vector<glm::vec3> emission, reflectance, irradiance;

  LitCube() {
    const std::size_t values = sides.back().first_value + sides.back().leaf_count;
    emission.assign(values, glm::vec3(0.0F));
    reflectance.assign(values, glm::vec3(0.5F));
    irradiance.assign(values, glm::vec3(1.0F));
    for (std::size_t i = 0; i < values; i += 3) irradiance[i] = glm::vec3(0.1F * static_cast<float>(i % 7));
    auto& lamp = lamps[0];
    lamp.corners = {glm::vec3(0.3F, 0.3F, 0.0F), {0.3F, -0.3F, 0.0F}, {-0.3F, -0.3F, 0.0F}, {-0.3F, 0.3F, 0.0F}};
    lamp.corner_count = 4;
    lamp.normal = {0.0F, 0.0F, -1.0F};
    lamp.area = 0.36F;
  }
  [[nodiscard]] LeafLight lit(float emitted) {
    lamps[0].emission = glm::vec3(emitted);
    return {emission, reflectance, {irradiance, irradiance}, lamps, {}};
  }
};

/// How often it had to be called.
int updateInSlices(LeafVariation& variation, const LeafLight& light) {
  int slices = 1;
  while (!variation.update(light, 0.0, 0.0)) ++slices;
  return slices;
}

void expectSame(const LeafVariation& one, const LeafVariation& other) {
  EXPECT_GT(one.corrections().size(), 0U);
  EXPECT_TRUE(std::ranges::equal(one.corrections(), other.corrections()));
  EXPECT_EQ(one.left(), other.left());
  EXPECT_EQ(one.noise(), other.noise());
  EXPECT_EQ(one.unsettled(), other.unsettled());
}

TEST(LeafVariation, InSlicesItComesToTheSame) {
  LitCube cube;
  LeafVariation whole(*cube.scene.patches, cube.sides, 1), sliced(*cube.scene.patches, cube.sides, 1);
  whole.update(cube.lit(2.0F), 0.0);
  EXPECT_GT(updateInSlices(sliced, cube.lit(2.0F)), 2);
  expectSame(sliced, whole);
  ASSERT_TRUE(whole.refine() && sliced.refine());
  whole.update(cube.lit(2.0F), 0.0);
  EXPECT_GT(updateInSlices(sliced, cube.lit(2.0F)), 0);
  expectSame(sliced, whole);
}

TEST(LeafVariation, ALampSwitchedBetweenSlicesIsSeenByAllPaths) {
  LitCube cube;
  LeafVariation whole(*cube.scene.patches, cube.sides, 1), sliced(*cube.scene.patches, cube.sides, 1);
  ASSERT_FALSE(sliced.update(cube.lit(0.0F), 0.0, 0.0));
  EXPECT_GT(updateInSlices(sliced, cube.lit(2.0F)), 2);
  whole.update(cube.lit(2.0F), 0.0);
  expectSame(sliced, whole);
}

}  // namespace
}  // namespace radiosity::solver
