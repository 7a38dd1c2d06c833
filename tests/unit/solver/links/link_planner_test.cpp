// Who shoots as one, and who is left to chance.
#include "server/solver/links/link_planner.h"

#include <gtest/gtest.h>

#include <optional>
#include <vector>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

/// A floor that shines evenly, of one of whose leaves a part is buried.
class BuriedEdgeTest : public testing::Test {
 protected:
  static constexpr std::uint32_t kLeaves = 8;
  static constexpr NodePlace kCut{0, 0, 1, 1};  ///< that leaf

  BuriedEdgeTest()
      : scene_(test::makeQuadScene({test::Quad{{0.0F, 0.0F, 0.0F}, {0.5F, 0.0F, 0.0F}, {0.0F, 0.5F, 0.0F}}})) {}

  /// `left`: of that leaf. A share is worth forty leaves.
  void plan(float left, std::uint64_t seed) {
    auto& patches = *scene_.patches;
    sides_ = makeSides(patches);
    const auto& side = sides_.front();
    const float leaf = patches.surfaces[0].texel_area;
    const float less = patches.node_area[nodeId(side, kCut)] - left * leaf;
    for (std::uint32_t level = 0; level < side.level_count; ++level)
      patches.node_area[nodeId(side, {0, level, kCut.x >> level, kCut.y >> level})] -= less;
    patches.leaves[kCut.y * kLeaves + kCut.x].full = false;
    const NodeShots shots(patches, sides_, seed);
    const PlannerSettings settings;
    LinkPlanner planner(patches, sides_, shots, settings, seed);
    UnshotPyramid unshot(patches);
    unshot.begin();
    unshot.pull(side, std::vector<glm::vec3>(side.leaf_count, glm::vec3(1.0F)));
    system_.emplace(patches, sides_);
    scene::SideColours emission(patches), reflectance(patches);
    emission.fill(glm::vec3(1.0F));
    reflectance.fill(glm::vec3(0.5F));
    system_->setMaterials(emission, reflectance);
    LinkMemory memory(patches, sides_, std::size_t{1} << 30U);
    memory.begin(*system_);
    planner.setReflectance(0.5);
    planner.setShare(40.0 * 3.0 * static_cast<double>(leaf));
    (void)planner.grow(*system_, unshot, patches, 1000, memory);
  }
  [[nodiscard]] const Shooter* shooterAt(const NodePlace& place) const {
    const auto index = system_->at(place.side, nodeId(sides_[place.side], place));
    return index == scene::kNone ? nullptr : &system_->shooters()[index];
  }

  test::QuadScene scene_;
  std::vector<Side> sides_;
  std::optional<LinkSystem> system_;
};

// Each of them lights one texel more than all others: one that stands for thirteen is a dot beside the edge.
TEST_F(BuriedEdgeTest, NobodyBesideItPlays) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    plan(0.15F, seed);  // 0.00375 of a share: would count thirteen times
    for (const auto& shooter : system_->shooters()) EXPECT_TRUE(shooter.certain) << "level " << shooter.place.level;
    ASSERT_NE(shooterAt(kCut), nullptr) << "seed " << seed;
  }
}

// Rays bring its light.
TEST_F(BuriedEdgeTest, WhoWouldCountTooOftenIsNoShooter) {
  plan(0.05F, 1);
  EXPECT_EQ(shooterAt(kCut), nullptr);
  EXPECT_NE(shooterAt({0, 0, 0, 0}), nullptr);
}

/// Lamps with samples of eight points in either half, which differ. The first shines a thousand times as brightly.
class Waves : public testing::Test {
 protected:
  struct Wanted {
    std::size_t all = 0, of_first = 0;
    bool lacks_samples = false;
  };
  /// `room`: bytes that are left, where a column of the first can grow by a thousand; 0: more than enough, of none.
  [[nodiscard]] Wanted plan(std::uint32_t samples, double target, std::uint32_t lamps = 1, std::size_t room = 0) const {
    LinkSystem system(*made_.patches, sides_);
    for (std::uint32_t lamp = 0; lamp < lamps; ++lamp) addLamp(system, lamp, samples);
    for (auto& shooter : system.shooters()) shooter.most_bytes = shooter.column[0].bytes();
    if (room > 0) system.shooters()[0].most_bytes += 1000;
    LinkMemory memory(*made_.patches, sides_, room > 0 ? system.bytes() + room : std::size_t{1} << 30U);
    memory.begin(system);
    const NodeShots shots(*made_.patches, sides_, 1);
    const PlannerSettings settings;
    LinkPlanner planner(*made_.patches, sides_, shots, settings, 1);
    const auto wanted = planner.improve(system, memory, {1.0, target});
    Wanted found{wanted.size(), 0, memory.lacksSamples()};
    for (const auto& want : wanted) {
      EXPECT_GE(want.index, samples) << "none is measured twice";
      found.of_first += want.shooter == 0 ? 1 : 0;
    }
    return found;
  }

 private:
  void addLamp(LinkSystem& system, std::uint32_t lamp, std::uint32_t samples) const {
    Shooter shooter;
    shooter.light = lamp;
    shooter.area = 0.1;
    shooter.sent.fill(glm::vec3(lamp == 0 ? 1.0F : 0.001F));
    (void)system.add(shooter);
    LinkExpander expander(*made_.patches, sides_);
    for (std::uint32_t k = 0; k < samples; ++k) {
      for (std::size_t half = 0; half < 2; ++half) {
        LinkSample sample;
        for (std::uint32_t leaf = 0; leaf < 16; ++leaf)
          sample.add(sides_[0].first_node + leaf, 0.1F + 0.02F * static_cast<float>((leaf + half) % 2));
        expander.expand(sample);
        system.addSample(lamp, half, expander, sample, kLightPoints);
      }
    }
  }

  test::QuadScene made_ = test::makeQuadScene(test::cubeQuads(4, test::kDark, test::kGrey));
  std::vector<Side> sides_ = makeSides(*made_.patches);
};

TEST_F(Waves, BringAsManySamplesAsThereAreAndNoMoreThanTheGoalNeeds) {
  EXPECT_EQ(plan(40, 1e-3).all, 2U * 40U);
  EXPECT_EQ(plan(3, 1e-3).all, 2U * 3U);
  // To 0.9 of the error, surely: the square of it falls as their number, 0.85 x 0.9 takes 1.71 times as many.
  EXPECT_NEAR(static_cast<double>(plan(100, 0.9).all), 2.0 * 71.0, 4.0);
}

// One that may only double will want more at once: what others could bring beside that is worth nothing.
TEST_F(Waves, OfOneNoisyLampAmongManyAreNearlyItsOwn) {
  const auto wanted = plan(40, 0.5, 200);
  EXPECT_EQ(wanted.of_first, 2U * 40U);
  EXPECT_LT(wanted.all, 2U * 40U + 2U * 64U) << "a usual wave more, at most";
}

TEST_F(Waves, TakeTheMemoryOfAColumnThatGrowsOnce) {
  const auto wanted = plan(40, 1e-3, 1, 2000);
  EXPECT_EQ(wanted.all, 2U * 40U);
  EXPECT_FALSE(wanted.lacks_samples);
  const auto refused = plan(40, 1e-3, 1, 1999);
  EXPECT_EQ(refused.all, 0U);
  EXPECT_TRUE(refused.lacks_samples);
}

}  // namespace
}  // namespace radiosity::solver
