#include "server/scene/values/side_colours.h"

#include <gtest/gtest.h>

#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {
namespace {

constexpr glm::vec3 kRed{0.5F, 0.0F, 0.0F}, kBlue{0.0F, 0.0F, 0.5F};

/// A surface of 2 x 2 leaves with both sides, one that has none, and one of a single leaf: sides 0, 1 and 2.
PatchScene threeSides() {
  PatchScene patches;
  Surface both, none, single;
  both.width = both.height = 2;
  both.level_count = 2;
  both.first_node = {0, 5};
  none.width = none.height = none.level_count = 1;
  single = none;
  single.first_node = {kNone, 10};
  patches.surfaces = {both, none, single};
  patches.node_area.assign(11, 1.0F);
  return patches;
}

TEST(SideColours, AreBlackUntilTheyAreFilledSideBySide) {
  SideColours colours(threeSides());
  ASSERT_EQ(colours.sideCount(), 3U);
  colours.fill(1, kRed);
  for (std::uint32_t node = 0; node < 11; ++node) {
    EXPECT_EQ(colours.sideOf(node), node / 5);
    EXPECT_EQ(colours[node], colours.sideOf(node) == 1 ? kRed : glm::vec3(0.0F)) << node;
  }
  colours.fill(kBlue);
  for (std::uint32_t node = 0; node < 11; ++node) EXPECT_EQ(colours[node], kBlue);
}

TEST(SideColours, OfOneColourKeepOne) {
  SideColours colours(threeSides());
  colours.assign(0, {kRed, kRed, kRed, kBlue, kRed});
  EXPECT_FALSE(colours.side(0).isUniform());
  EXPECT_EQ(colours[3], kBlue);
  EXPECT_EQ(colours[8], glm::vec3(0.0F)) << "the back has its own";
  colours.set(3, kRed);
  EXPECT_TRUE(colours.side(0).isUniform());
  EXPECT_EQ(colours.side(0)[4], kRed);
  colours.set(5, kBlue);
  EXPECT_FALSE(colours.side(1).isUniform());
  EXPECT_EQ(colours[5], kBlue);
  EXPECT_EQ(colours[6], glm::vec3(0.0F));
  colours.scale({1.0F, 1.0F, 2.0F});
  EXPECT_EQ(colours[5], 2.0F * kBlue);
  EXPECT_EQ(colours[0], kRed);
}

TEST(SideColours, OfACopyStayWhatTheyAreWhenTheOthersChange) {
  SideColours colours(threeSides());
  colours.fill(kRed);
  colours.assign(1, {kRed, kBlue, kRed, kRed, kRed});
  const SideColours copy = colours;
  EXPECT_EQ(copy, colours);
  colours.fill(0, kBlue);
  colours.set(6, kRed);
  EXPECT_NE(copy, colours);
  EXPECT_EQ(copy[0], kRed);
  EXPECT_EQ(copy[6], kBlue);
  colours.fill(0, kRed);
  colours.set(6, kBlue);
  EXPECT_EQ(copy, colours) << "equal, not the same";
}

}  // namespace
}  // namespace radiosity::scene
