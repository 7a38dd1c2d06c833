// Which lamps are gathered as polygons: those that shine whole.
#include "server/solver/patches/lights.h"

#include <gtest/gtest.h>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;

struct Found {
  std::vector<LightPolygon> lights;
  std::vector<Side> sides;
};

/// In a cube whose ceiling shines, with so much of each leaf of it in its first `columns`, of 4. One leaf shines so
/// many times as brightly.
Found find(std::uint32_t columns, float part, float brighter = 1.0F) {
  const auto made = makeQuadScene(cubeQuads(4, {0, 4, 0, 0, 0, 0}, test::kGrey));
  const auto first = made.patches->surfaces[1].first_node[0];
  for (std::uint32_t leaf = 0; leaf < 16; ++leaf)
    if (leaf % 4 < columns) made.patches->node_area[first + leaf] *= part;
  Found found{{}, makeSides(*made.patches)};
  auto emission = made.materials.emission;
  emission.set(first + 5, glm::vec3(4.0F * brighter));
  found.lights = findLightPolygons(*made.patches, found.sides, emission);
  return found;
}

TEST(LightPolygons, AreFoundOfALampThatCanBeSeenWhole) {
  for (const float part : {1.0F, 0.9996F}) {
    const auto found = find(4, part);
    ASSERT_EQ(found.lights.size(), 1U) << part;
    EXPECT_NEAR(found.lights[0].area, 1.0, 1e-6);
    EXPECT_TRUE(found.sides[1].gathered);
    EXPECT_FALSE(found.sides[0].gathered);
  }
}

// One that something covers, or that stands in a solid, in part: a polygon would shine whole.
TEST(LightPolygons, AreNotFoundOfALampThatIsHiddenInPart) {
  for (const std::uint32_t columns : {1U, 2U, 4U}) {
    for (const float part : {0.0F, 0.5F, 0.99F}) {
      const auto found = find(columns, part);
      EXPECT_TRUE(found.lights.empty()) << columns << ' ' << part;
      EXPECT_FALSE(found.sides[1].gathered) << columns << ' ' << part;
    }
  }
}

// Means over a texture of one colour are rounded. What is told apart would take many images in the place of a polygon.
TEST(LightPolygons, ShineAlikeAllOver) {
  EXPECT_EQ(find(4, 1.0F, 1.000002F).lights.size(), 1U);
  for (const float brighter : {0.0F, 0.999F, 1.001F}) EXPECT_TRUE(find(4, 1.0F, brighter).lights.empty()) << brighter;
}

}  // namespace
}  // namespace radiosity::solver
