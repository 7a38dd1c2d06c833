#include "server/solver/patches/slivers.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "server/solver/transport/link_expander.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

/// A floor of 4 x 4 leaves of 0.25 that faces up, and rectangles of one leaf.
class Slivers : public testing::Test {
 protected:
  static constexpr float kEdge = 0.01F;

  void make(const std::vector<test::Quad>& others) {
    std::vector<test::Quad> quads{{{0, 0, 0}, {0, 0, 1}, {1, 0, 0}, 4, 4, {}, {}}};
    quads.insert(quads.end(), others.begin(), others.end());
    made_ = test::makeQuadScene(quads);
    sides_ = makeSides(*made_.patches);
  }
  /// Beside the last leaf of the floor; up or down.
  static test::Quad tiny(float away, bool up = true) {
    const glm::vec3 x{kEdge, 0, 0}, z{0, 0, kEdge};
    return {{1.0F + away, 0, 0.9F}, up ? z : x, up ? x : z, 1, 1, {}, {}};
  }
  [[nodiscard]] const Sliver* of(const std::vector<Sliver>& slivers, std::uint32_t side) const {
    const auto found =
        std::find_if(slivers.begin(), slivers.end(), [&](const auto& s) { return s.sliver_side == side; });
    return found == slivers.end() ? nullptr : &*found;
  }
  /// What arrives at leaf value `value`.
  [[nodiscard]] static float at(const LinkExpander& links, std::uint32_t value) { return links.values()[value]; }

  test::QuadScene made_;
  std::vector<Side> sides_;
};

TEST_F(Slivers, ShareWithTheNearestLargerLeafThatFacesTheirWay) {
  make({tiny(0.0F)});
  const auto slivers = findSlivers(*made_.patches, sides_);
  ASSERT_EQ(slivers.size(), 1U);
  EXPECT_EQ(slivers[0].sliver, sides_[1].first_value);
  EXPECT_EQ(slivers[0].sliver_side, 1U);
  EXPECT_EQ(slivers[0].leaf_side, 0U);
  // du runs along z, dv along x: the leaf at z of 0.75 to 1, x of 0.75 to 1 is the last.
  EXPECT_EQ(slivers[0].leaf, sides_[0].first_value + 15);
}

TEST_F(Slivers, ThatFaceTheOtherWayOrLieFarOffOrBelongToSomethingElseShareWithNone) {
  make({tiny(0.0F, false), tiny(1.0F), tiny(0.1F)});
  EXPECT_EQ(of(findSlivers(*made_.patches, sides_), 1), nullptr);
  EXPECT_EQ(of(findSlivers(*made_.patches, sides_), 2), nullptr);
  EXPECT_NE(of(findSlivers(*made_.patches, sides_), 3), nullptr);
  made_.patches->surfaces[sides_[3].surface].instance = 1;
  EXPECT_TRUE(findSlivers(*made_.patches, sides_).empty()) << "by themselves they are no slivers";
}

TEST_F(Slivers, ThatAreAFinerChartBesideACoarseOneKeepWhatTheyShow) {
  // 8 x 8 leaves of a hundredth each: more than the one leaf of a sixteenth that all of them are nearest to.
  make({{{0.9F, 0, 0.75F}, {0, 0, 0.3F}, {0.3F, 0, 0}, 8, 8, {}, {}}});
  for (const auto& sliver : findSlivers(*made_.patches, sides_)) EXPECT_NE(sliver.leaf, sides_[0].first_value + 15);
  make({{{0.9F, 0, 0.85F}, {0, 0, 0.06F}, {0.06F, 0, 0}, 2, 2, {}, {}}});
  EXPECT_EQ(findSlivers(*made_.patches, sides_).size(), 4U);
}

TEST_F(Slivers, OnTheOtherFaceOfAShelfShareWithNone) {
  auto under = tiny(-0.05F);
  under.origin.y = -0.2F;
  make({under});
  EXPECT_TRUE(findSlivers(*made_.patches, sides_).empty());
  under.origin.y = -0.05F;
  make({under});
  EXPECT_EQ(findSlivers(*made_.patches, sides_).size(), 1U);
}

TEST_F(Slivers, OfAScatteredSampleGetWhatTheLeafBesideThemGetsAndAllOfItStays) {
  make({tiny(0.0F)});
  LinkSample hit;  // one pixel, on so small a place
  hit.add(sides_[1].first_node, 58.0F);
  const std::uint32_t sliver = sides_[1].first_value, leaf = sides_[0].first_value + 15;
  LinkExpander links(*made_.patches, sides_);
  links.expand(hit);
  EXPECT_EQ(at(links, sliver), 58.0F) << "a gathered one is exact";
  const double flux = links.flux();
  links.expand(hit, true);
  EXPECT_NEAR(links.flux() / flux, 1.0, 1e-6);
  EXPECT_EQ(at(links, sliver), at(links, leaf));
  const float area = kEdge * kEdge, whole = 1.0F / 16.0F;
  EXPECT_NEAR(at(links, sliver), 58.0F * area / (area + whole), 1e-4F);
  ASSERT_EQ(links.sidesReached().size(), 2U);
  EXPECT_LT(links.sidesReached()[0], links.sidesReached()[1]);
  for (std::uint32_t other = 0; other < 15; ++other) EXPECT_EQ(at(links, sides_[0].first_value + other), 0.0F);

  LinkSample missed;  // as most do
  missed.add(sides_[0].first_node + 15, 0.5F);
  links.expand(missed, true);
  EXPECT_EQ(at(links, sliver), at(links, leaf));
  EXPECT_NEAR(at(links, sliver), 0.5F * whole / (area + whole), 1e-4F);
  LinkSample elsewhere;
  elsewhere.add(sides_[0].first_node, 0.5F);
  links.expand(elsewhere, true);
  EXPECT_EQ(links.sidesReached().size(), 1U) << "what gets nothing takes no memory";
  EXPECT_EQ(at(links, sides_[0].first_value), 0.5F);
}

}  // namespace
}  // namespace radiosity::solver
