// Who shoots as one, and who is left to chance.
#include "server/solver/link_planner.h"

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
    left_out_leaves_ = planner.leftOut() / (3.0 * static_cast<double>(leaf));
  }
  [[nodiscard]] const Shooter* shooterAt(const NodePlace& place) const {
    const auto index = system_->at(place.side, nodeId(sides_[place.side], place));
    return index == scene::kNone ? nullptr : &system_->shooters()[index];
  }

  test::QuadScene scene_;
  std::vector<Side> sides_;
  std::optional<LinkSystem> system_;
  double left_out_leaves_ = 0.0;
};

// Each of them lights one texel more than all others: one that stands for thirteen is a dot beside the edge.
TEST_F(BuriedEdgeTest, NobodyBesideItPlays) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    plan(0.15F, seed);  // 0.00375 of a share: would count thirteen times
    for (const auto& shooter : system_->shooters()) EXPECT_TRUE(shooter.certain) << "level " << shooter.place.level;
    ASSERT_NE(shooterAt(kCut), nullptr) << "seed " << seed;
    EXPECT_EQ(left_out_leaves_, 0.0);
  }
}

TEST_F(BuriedEdgeTest, WhoWouldCountTooOftenIsLeftOutAndToldOf) {
  plan(0.05F, 1);
  EXPECT_EQ(shooterAt(kCut), nullptr);
  EXPECT_NE(shooterAt({0, 0, 0, 0}), nullptr);
  EXPECT_NEAR(left_out_leaves_, 0.05, 1e-4);
}

}  // namespace
}  // namespace radiosity::solver
