// A file's own layout: islands that keep apart stay, those that light would bleed between are charted anew.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "server/scene/patch_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

constexpr const char* kWarning = "islands of TEXCOORD_1 are so close";

/// A square metre on the floor at x, whose UVs are the rectangle from (u, v), `side` wide and high.
void addSquare(Primitive& p, double x, double u, double v, double side) {
  addQuad(p, {x, 0, 0}, {x, 0, 1}, {x + 1, 0, 1}, {x + 1, 0, 0});
  for (const auto& at : {glm::dvec2(0, 0), glm::dvec2(0, 1), glm::dvec2(1, 1), glm::dvec2(1, 0)})
    p.texcoord1.emplace_back(glm::dvec2(u, v) + at * side);
}

/// Texels of 0.1 m: the squares, 0.1 of UV each, have ten on a side.
PatchScene atTenTexels(const Primitive& p) {
  ChartOptions options;
  options.texel_size_m = 0.1;
  auto patches = buildPatchScene(sceneOf(p), options);
  EXPECT_TRUE(patches) << patches.error().text();
  return *std::move(patches);
}

bool keepsItsLayout(const PatchScene& patches) {
  const bool warned = !patches.warnings.empty();
  if (warned) {
    EXPECT_THAT(patches.warnings, testing::ElementsAre(testing::HasSubstr(kWarning)));
  }
  return !warned;
}

TEST(ChartsUv, IslandsTwoTexelsApartKeepTheirLayout) {
  Primitive p;
  addSquare(p, 0, 0.1, 0.1, 0.1);
  addSquare(p, 5, 0.22, 0.1, 0.1);  // 2 texels beside it
  addSquare(p, 10, 0.1, 0.22, 0.1);
  EXPECT_TRUE(keepsItsLayout(atTenTexels(p)));
}

TEST(ChartsUv, IslandsThatTouchOrAreATexelApartAreChartedAnew) {
  for (const double gap : {0.0, 0.01}) {
    Primitive p;
    addSquare(p, 0, 0.1, 0.1, 0.1);
    addSquare(p, 5, 0.2 + gap, 0.1, 0.1);
    const auto patches = atTenTexels(p);
    EXPECT_FALSE(keepsItsLayout(patches)) << gap;
    ASSERT_EQ(patches.surfaces.size(), 2U);
    const auto &a = patches.surfaces[0], &b = patches.surfaces[1];
    EXPECT_TRUE(a.page_x + a.width + 2 <= b.page_x || b.page_x + b.width + 2 <= a.page_x ||
                a.page_y + a.height + 2 <= b.page_y || b.page_y + b.height + 2 <= a.page_y);
  }
}

TEST(ChartsUv, IslandsThatMeetAtACornerAreChartedAnew) {
  Primitive p;
  addSquare(p, 0, 0.1, 0.1, 0.1);
  addSquare(p, 5, 0.205, 0.205, 0.1);
  EXPECT_FALSE(keepsItsLayout(atTenTexels(p)));
}

TEST(ChartsUv, HowCloseIsTooCloseDependsOnTheTexels) {
  Primitive p;
  addSquare(p, 0, 0.1, 0.1, 0.1);
  addSquare(p, 5, 0.21, 0.1, 0.1);  // a texel at ten on a side, four at forty
  ChartOptions fine;
  fine.texel_size_m = 0.025;
  EXPECT_TRUE(keepsItsLayout(buildPatchScene(sceneOf(p), fine).value()));
  EXPECT_FALSE(keepsItsLayout(atTenTexels(p)));
}

TEST(ChartsUv, PiecesThatContinueEachOtherMayMeet) {
  Primitive p;  // no vertices, and so no edges, in common: a T
  addQuad(p, {0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0});
  addQuad(p, {1, 0, 0}, {1, 0, 0.5}, {1.5, 0, 0.5}, {1.5, 0, 0});
  addQuad(p, {1, 0, 0.5}, {1, 0, 1}, {1.5, 0, 1}, {1.5, 0, 0.5});
  for (const auto& position : p.positions) p.texcoord1.emplace_back(0.1 + 0.1 * position.x, 0.1 + 0.1 * position.z);
  EXPECT_TRUE(keepsItsLayout(atTenTexels(p)));
}

TEST(ChartsUv, TheTwoSidesOfASheetDoNotContinueEachOther) {
  Primitive p;
  addSquare(p, 0, 0.1, 0.1, 0.1);
  addQuad(p, {0, -0.001, 0}, {1, -0.001, 0}, {1, -0.001, 1}, {0, -0.001, 1});  // faces down
  for (const auto& at : {glm::dvec2(0.3, 0.1), glm::dvec2(0.2, 0.1), glm::dvec2(0.2, 0.2), glm::dvec2(0.3, 0.2)})
    p.texcoord1.emplace_back(at);
  EXPECT_FALSE(keepsItsLayout(atTenTexels(p)));
}

TEST(ChartsUv, OneOfManyObjectsIsChartedAnewAloneAndNamed) {
  Primitive good, bad;
  addSquare(good, 0, 0.1, 0.1, 0.1);
  addSquare(bad, 20, 0.1, 0.1, 0.1);
  addSquare(bad, 25, 0.2, 0.1, 0.1);
  Scene scene = sceneOf(good);
  place(scene, bad);
  ChartOptions options;
  options.texel_size_m = 0.1;
  const auto patches = buildPatchScene(scene, options).value();
  ASSERT_EQ(patches.warnings.size(), 1U);
  EXPECT_THAT(patches.warnings[0], testing::HasSubstr("/nodes/1"));
  EXPECT_EQ(patches.surfaces.size(), 3U);
}

TEST(ChartsUv, AnEditKeepsWhatWasDecided) {
  Primitive p;
  addSquare(p, 0, 0.1, 0.1, 0.1);
  addSquare(p, 5, 0.2, 0.1, 0.1);
  Scene scene = sceneOf(p);
  const auto before = buildPatchScene(scene, {}).value();
  const FormerScene former{scene, before};
  const auto after = buildPatchScene(scene, {}, &former).value();
  EXPECT_EQ(before.warnings, after.warnings);
  ASSERT_EQ(before.surfaces.size(), after.surfaces.size());
  for (std::size_t i = 0; i < before.surfaces.size(); ++i)
    EXPECT_EQ(before.surfaces[i].page_x, after.surfaces[i].page_x);
}

}  // namespace
}  // namespace radiosity::scene::test
