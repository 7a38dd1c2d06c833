// Rooms that no light reaches, and the texels that would let some in.
#include "server/scene/dark_texels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <glm/geometric.hpp>
#include <set>
#include <utility>

#include "server/scene/lightmap.h"
#include "tests/unit/scene/built_scene.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene {
namespace {

using test::build;

PunctualLight sun() {
  PunctualLight light;
  light.kind = LightKind::kDirectional;
  light.direction = glm::normalize(glm::dvec3(1, -2, 0.5));
  light.intensity = glm::vec3(1000.0F);
  return light;
}

PunctualLight lampAt(glm::dvec3 position) {
  PunctualLight light;
  light.kind = LightKind::kPoint;
  light.position = position;
  light.intensity = glm::vec3(100.0F);
  return light;
}

Material sheet() {
  Material material;
  material.double_sided = true;
  return material;
}

/// Walls and a roof around 4 x 3 x 4 m, as solids, or sheets where they have no thickness, on a ground of 20 m, which
/// is instance 0. `window`: one wall is half as high.
Scene hut(double thickness, bool window = false, double size = 4.0) {
  Scene scene;
  test::place(scene, test::floorQuad(20, -10, -10));
  const double a = -0.5 * size + 0.17, b = a + size, t = thickness, high = window ? 0.4 * size : 0.75 * size;
  if (t == 0.0) {
    Primitive walls = test::box({a, 0, a}, {b, 0.75 * size, b});
    walls.indices.erase(walls.indices.begin(), walls.indices.begin() + (window ? 12 : 6));  // it stands on the ground
    test::place(scene, std::move(walls), glm::dmat4(1.0), sheet());
  } else {
    test::place(scene, test::box({a - t, 0, a - t}, {a, high, b + t}));
    test::place(scene, test::box({b, 0, a - t}, {b + t, 0.75 * size, b + t}));
    test::place(scene, test::box({a, 0, a - t}, {b, 0.75 * size, a}));
    test::place(scene, test::box({a, 0, b}, {b, 0.75 * size, b + t}));
    test::place(scene, test::box({a - t, 0.75 * size, a - t}, {b + t, 0.75 * size + t, b + t}));
  }
  scene.lights.push_back(sun());
  return scene;
}

/// All texels that lookups on the ground mix in at a place, in the world.
bool isDarkAt(const PatchScene& patches, glm::dvec3 world) {
  const auto& ground = patches.surfaces[0];
  const auto& frame = patches.triangles[ground.first_triangle];
  const glm::dvec3 way = (world - patches.centre) / patches.scale - glm::dvec3(frame.origin);
  const glm::dvec2 texel(glm::dot(way, glm::dvec3(frame.du)) / glm::dot(glm::dvec3(frame.du), glm::dvec3(frame.du)),
                         glm::dot(way, glm::dvec3(frame.dv)) / glm::dot(glm::dvec3(frame.dv), glm::dvec3(frame.dv)));
  std::set<std::pair<std::int32_t, std::int32_t>> dark;
  for (const auto& one : patches.dark_texels)
    if (one.surface == 0 && one.side == 0) dark.insert({one.x, one.y});
  const glm::ivec2 low(glm::floor(texel - 0.5));
  for (int dy = 0; dy < 2; ++dy)
    for (int dx = 0; dx < 2; ++dx)
      if (!dark.contains({low.x + dx, low.y + dy})) return false;
  return true;
}

class Huts : public testing::TestWithParam<double> {};

TEST_P(Huts, nothingThatIsLitIsMixedInBesideTheWallsWithin) {
  for (const std::uint64_t budget : {200U, 2000U, 16000U}) {
    const auto patches = build(hut(GetParam()), budget);
    for (double along = 0.01; along < 3.99; along += 0.0737) {
      for (const double near : {0.001, 0.01}) {
        EXPECT_TRUE(isDarkAt(patches, {-1.83 + near, 0, -1.83 + along})) << budget << " texels, " << along;
        EXPECT_TRUE(isDarkAt(patches, {2.17 - near, 0, -1.83 + along})) << budget << " texels, " << along;
        EXPECT_TRUE(isDarkAt(patches, {-1.83 + along, 0, -1.83 + near})) << budget << " texels, " << along;
      }
    }
  }
}

TEST_P(Huts, noMoreThanARimOutsideIsDark) {
  const auto patches = build(hut(GetParam()), 16000);
  const double texel = patches.texel * patches.scale;
  for (double along = 0.0; along < 4.0; along += 0.0737) {
    EXPECT_FALSE(isDarkAt(patches, {-1.83 - GetParam() - 2.1 * texel, 0, -1.83 + along}));
    EXPECT_FALSE(isDarkAt(patches, {-1.83 + along, 0, 2.17 + GetParam() + 2.1 * texel}));
  }
}

TEST_P(Huts, leavesAcrossAWallStandInTheDark) {
  const auto patches = build(hut(GetParam()), 16000);
  for (std::uint32_t i = 0; i < patches.surfaces[0].width * patches.surfaces[0].height; ++i) {
    const auto& leaf = patches.leaves[i];
    const auto& frame = patches.triangles[patches.surfaces[0].first_triangle];
    const auto at = [&](const glm::vec2& texel) {
      return glm::dvec3(frame.origin + texel.x * frame.du + texel.y * frame.dv) * patches.scale + patches.centre;
    };
    const auto within = [](const glm::dvec3& p) { return std::max(std::abs(p.x - 0.17), std::abs(p.z - 0.17)) < 2.0; };
    const glm::vec2 corner(i % patches.surfaces[0].width, i / patches.surfaces[0].width);
    bool reaches_in = false;
    for (const auto& to : {glm::vec2(0.02F), glm::vec2(0.98F, 0.02F), glm::vec2(0.02F, 0.98F), glm::vec2(0.98F)})
      reaches_in = reaches_in || within(at(corner + to));
    if (!reaches_in || leaf.triangle == kNone) continue;
    EXPECT_TRUE(within(at(leaf.texel))) << corner.x << " " << corner.y;
  }
}

TEST_P(Huts, aWindowLetsLightIn) { EXPECT_TRUE(build(hut(GetParam(), true), 4000).dark_texels.empty()); }

TEST_P(Huts, aLampWithinLightsIt) {
  auto scene = hut(GetParam());
  scene.lights.push_back(lampAt({0, 2, 0}));
  EXPECT_TRUE(build(scene, 4000).dark_texels.empty());
}

TEST_P(Huts, whatNobodyStandsInCastsNoRim) {
  EXPECT_TRUE(build(hut(GetParam(), false, 0.5), 16000).dark_texels.empty());
}

INSTANTIATE_TEST_SUITE_P(DarkTexels, Huts, testing::Values(0.0, 0.001, 0.05));

TEST(DarkTexels, areNoneWhereNothingShines) {
  auto scene = hut(0.05);
  scene.lights.clear();
  EXPECT_TRUE(build(scene, 4000).dark_texels.empty());
}

TEST(DarkTexels, theDarkOutsideOfALitHutDarkensNothingWithin) {
  auto scene = hut(0.0);
  scene.lights = {lampAt({0, 2, 0})};
  EXPECT_TRUE(build(scene, 4000).dark_texels.empty());
}

TEST(DarkTexels, areTheSameForTheSameScene) {
  const auto one = build(hut(0.05), 4000), other = build(hut(0.05), 4000);
  EXPECT_FALSE(one.dark_texels.empty());
  EXPECT_EQ(one.dark_texels, other.dark_texels);
}

TEST(DarkTexels, anEditThatLightsTheRoomOrDarkensItIsNoted) {
  const auto dark = hut(0.05);
  auto lit = dark;
  lit.lights.push_back(lampAt({0, 2, 0}));
  EXPECT_TRUE(reachesDarkSides(build(dark, 4000), dark, {}, lit, {}));
  EXPECT_TRUE(reachesDarkSides(build(lit, 4000), lit, {}, dark, {}));
  auto elsewhere = dark;
  elsewhere.lights.push_back(lampAt({7, 2, 7}));
  EXPECT_FALSE(reachesDarkSides(build(dark, 4000), dark, {}, elsewhere, {}));
}

TEST(DarkTexels, pagesHaveNoLightThereWhateverTheLeafGets) {
  const auto patches = build(hut(0.05), 4000);
  const auto pages = assemblePages(patches, std::vector<glm::vec3>(patches.nodeCount(), glm::vec3(1.0F)));
  const auto kept = assemblePages(patches, std::vector<glm::vec3>(patches.nodeCount(), glm::vec3(1.0F)), Seams::kLeft);
  ASSERT_FALSE(patches.dark_texels.empty());
  for (const auto& texel : patches.dark_texels) {
    const auto& place = patches.surfaces[texel.surface].place[texel.side];
    const int x = static_cast<int>(place.x) + texel.x, y = static_cast<int>(place.y) + texel.y;
    if (x < 0 || y < 0) continue;
    EXPECT_EQ(pages[place.page].irradiance.at(x, y), glm::vec3(0.0F));
  }
  // Other quantities are what they are there.
  const auto& place = patches.surfaces[0].place[0];
  for (const auto& texel : patches.dark_texels) {
    if (texel.surface != 0) continue;
    EXPECT_EQ(kept[place.page].irradiance.at(static_cast<int>(place.x) + texel.x, static_cast<int>(place.y) + texel.y),
              glm::vec3(1.0F));
  }
}

}  // namespace
}  // namespace radiosity::scene
