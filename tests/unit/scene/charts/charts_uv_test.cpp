// A file's own layout: islands that keep apart stay, those that light would bleed between are charted anew.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <glm/common.hpp>
#include <string>
#include <vector>

#include "server/scene/charts/build.h"
#include "server/scene/lightmap/lightmap.h"
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
    EXPECT_TRUE(a.place[0].x + a.width + 2 <= b.place[0].x || b.place[0].x + b.width + 2 <= a.place[0].x ||
                a.place[0].y + a.height + 2 <= b.place[0].y || b.place[0].y + b.height + 2 <= a.place[0].y);
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

float lookUp(const Image& page, const glm::vec2& uv) {
  const glm::vec2 most(page.width - 1, page.height - 1);
  const glm::vec2 at = glm::clamp(uv * glm::vec2(page.width, page.height) - 0.5F, glm::vec2(0.0F), most);
  const glm::ivec2 low(at), high = glm::min(low + 1, glm::ivec2(most));
  const glm::vec2 part = at - glm::vec2(low);
  return glm::mix(glm::mix(page.at(low.x, low.y).x, page.at(high.x, low.y).x, part.x),
                  glm::mix(page.at(low.x, high.y).x, page.at(high.x, high.y).x, part.x), part.y);
}

/// The most that lookups along the edges of the dark square find, where the other one has the light 1.
float mostInTheDark(const PatchScene& patches) {
  std::vector<glm::vec3> values(patches.nodeCount(), glm::vec3(0.0F));
  const auto& lit = patches.surfaces.at(1);
  for (std::uint32_t leaf = 0; leaf < lit.width * lit.height; ++leaf)
    values[lit.first_node[0] + leaf] = glm::vec3(1.0F);
  const auto pages = assemblePages(patches, values);
  const auto& uvs = patches.instance_uvs.at(0).side[0];
  float most = 0.0F;
  for (std::size_t t = 0; t < 2; ++t)  // of the dark square
    for (int step = 0; step <= 40; ++step)
      for (std::size_t edge = 0; edge < 3; ++edge) {
        const auto uv =
            glm::mix(uvs.corners[t][edge], uvs.corners[t][(edge + 1) % 3], static_cast<float>(step) / 40.0F);
        most = std::max(most, lookUp(pages.at(uvs.page[t]).irradiance, uv));
      }
  return most;
}

TEST(ChartsUv, WhereTheLayoutStaysNoLightBleeds) {
  int kept = 0, replaced = 0;
  for (int i = 0; i < 200; ++i) {
    const double gap = 0.01 + 0.0001 * ((i * 37) % 130);  // 1 to 2.3 texels
    const double u = 0.1 + 0.0001 * ((i * 61) % 100), v = 0.1 + 0.0001 * ((i * 17) % 100);
    Primitive p;
    addSquare(p, 0, u, v, 0.1);
    addSquare(p, 5, u + 0.1 + gap, v + 0.003, 0.1);
    const auto patches = atTenTexels(p);
    (keepsItsLayout(patches) ? kept : replaced) += 1;
    EXPECT_LT(mostInTheDark(patches), 2e-3F) << gap << " at " << u << ", " << v;
  }
  EXPECT_GT(kept, 50);  // or nothing was tested
  EXPECT_GT(replaced, 50);
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
    EXPECT_EQ(before.surfaces[i].place[0].x, after.surfaces[i].place[0].x);
}

}  // namespace
}  // namespace radiosity::scene::test
