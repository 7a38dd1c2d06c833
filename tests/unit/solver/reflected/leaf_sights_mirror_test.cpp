// Rays that meet mirrors go on.
#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <vector>

#include "server/solver/reflected/leaf_sights.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::kDark;
using test::kGrey;
using test::makeQuadScene;

/// A cube of which one wall is a mirror.
class MirrorCube : public testing::Test {
 protected:
  static constexpr std::uint32_t kMirror = 1;

  MirrorCube() : made_(makeQuadScene(cubeQuads(4, kDark, kGrey))), sides_(makeSides(*made_.patches)) {
    made_.materials.specular = made_.materials.lobe = scene::SideColours(*made_.patches);
    made_.materials.specular.fill(sides_[kMirror].number, glm::vec3(1.0F));
  }

  [[nodiscard]] std::shared_ptr<const SpecularLeaves> mirrors(float roughness) {
    made_.materials.lobe.fill(sides_[kMirror].number, glm::vec3(roughness, 1.0F, 0.0F));
    return SpecularLeaves::find(sides_, made_.materials, made_.patches->surfaces);
  }

  void trace(LeafSights& sights, std::uint16_t count) const {
    sights.ask(std::vector<std::uint16_t>(sights.leafCount(), count));
    ASSERT_TRUE(sights.trace(HUGE_VAL));
  }

  test::QuadScene made_;
  std::vector<Side> sides_;
};

TEST_F(MirrorCube, RaysThatMeetItGoOnToWhatItShows) {
  LeafSights sights(*made_.patches, sides_, 1);
  sights.reflectBy(mirrors(0.0F));
  trace(sights, 256);
  double met = 0.0, all = 0.0;
  for (auto v = sides_[0].first_value; v < sides_[0].first_value + sides_[0].leaf_count; ++v) {
    for (const auto end : sights.seen(0, v)) {
      all += 1.0;
      if (end < sights.endCount()) continue;
      met += 1.0;
      const auto& step = sights.steps(0)[end - sights.endCount()];
      ASSERT_TRUE(SpecularStep::is(step.by));
      EXPECT_EQ(sights.sideOf(LeafSights::leafOf(step)), kMirror);
      ASSERT_LT(step.next, sights.leafCount());
      EXPECT_NE(sights.sideOf(step.next), kMirror);
    }
  }
  EXPECT_NEAR(met / all, 0.1998, 0.01);
}

TEST_F(MirrorCube, AnotherRoughnessCastsOnlyRaysAnewThatMetIt) {
  LeafSights sights(*made_.patches, sides_, 1);
  sights.reflectBy(mirrors(0.1F));
  trace(sights, 64);
  std::vector<std::vector<std::uint32_t>> before;
  std::uint64_t met = 0;
  for (std::uint32_t v = 0; v < sights.leafCount(); ++v) {
    auto& of_leaf = before.emplace_back();
    for (const auto end : sights.seen(0, v)) of_leaf.push_back(end);
    for (std::size_t half = 0; half < 2; ++half)
      for (const auto end : sights.seen(half, v)) met += end >= sights.endCount() ? 1 : 0;
  }
  const auto traced = sights.traced();
  sights.reflectBy(mirrors(0.1F));
  EXPECT_TRUE(sights.isTraced()) << "nothing is other than it was";
  sights.reflectBy(mirrors(0.5F));
  EXPECT_EQ(sights.untraced(), met);
  ASSERT_TRUE(sights.trace(HUGE_VAL));
  EXPECT_EQ(sights.traced() - traced, met);
  for (std::uint32_t v = 0; v < sights.leafCount(); ++v) {
    std::size_t k = 0;
    for (const auto end : sights.seen(0, v)) {
      if (before[v][k] < sights.endCount()) {
        EXPECT_EQ(end, before[v][k]);
      }
      ++k;
    }
  }
}

TEST_F(MirrorCube, WhatIsNoMirrorAnyMoreEndsRaysAgain) {
  LeafSights plain(*made_.patches, sides_, 1), sights(*made_.patches, sides_, 1);
  trace(plain, 64);
  sights.reflectBy(mirrors(0.3F));
  trace(sights, 64);
  sights.reflectBy(nullptr);
  ASSERT_TRUE(sights.trace(HUGE_VAL));
  for (std::uint32_t v = 0; v < sights.leafCount(); ++v) {
    std::vector<std::uint32_t> of_plain, of_other;
    for (const auto end : plain.seen(1, v)) of_plain.push_back(end);
    for (const auto end : sights.seen(1, v)) of_other.push_back(end);
    EXPECT_EQ(of_plain, of_other);
  }
}

TEST_F(MirrorCube, ARayThatEndsOnAnotherMirrorIsDoubtful) {
  for (std::uint32_t s = 1; s < 6; ++s) made_.materials.specular.fill(sides_[s].number, glm::vec3(1.0F));
  LeafSights sights(*made_.patches, sides_, 1);
  sights.reflectBy(mirrors(0.0F));
  trace(sights, 256);
  std::size_t cut_off = 0;
  for (auto v = sides_[0].first_value; v < sides_[0].first_value + sides_[0].leaf_count; ++v) {
    for (const auto ray : sights.seen(0, v)) {
      auto end = ray;
      while (end >= sights.endCount()) end = sights.steps(0)[end - sights.endCount()].next;
      const bool is_cut_off = sights.sideOf(end) != 0;
      EXPECT_EQ(sights.isDoubtful(0, ray), is_cut_off);
      cut_off += is_cut_off ? 1 : 0;
    }
  }
  EXPECT_GT(cut_off, 0U) << "some are reflected more than eight times before they meet the floor again";
}

TEST(SpecularStep, HoldsItsLeafAndTheMeanOfItsEdge) {
  const SpecularStep step{12'345'678, 11, true};
  ASSERT_TRUE(SpecularStep::is(step.code()));
  const auto read = SpecularStep::of(step.code());
  EXPECT_EQ(read.leaf, step.leaf);
  EXPECT_EQ(read.level, step.level);
  EXPECT_TRUE(read.is_again);
  EXPECT_FALSE(SpecularStep::is(12'345'678));
  double sum = 0.0;
  for (int i = 0; i < 1000; ++i)
    sum += static_cast<double>(SpecularStep{0, SpecularStep::levelOf(0.37, (i + 0.5) / 1000.0), false}.edge());
  EXPECT_NEAR(sum / 1000.0, 0.37, 1e-3);
}

}  // namespace
}  // namespace radiosity::solver
