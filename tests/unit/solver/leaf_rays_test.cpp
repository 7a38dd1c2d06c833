// Which leaf a ray sees where surfaces lie on each other.
#include "server/solver/leaf_rays.h"

#include <gtest/gtest.h>

#include "tests/unit/scene/shapes.h"

namespace radiosity::solver {
namespace {

void addFloor(scene::Primitive& mesh, double x, double z, double width, double depth) {
  scene::test::addQuad(mesh, {x, 0, z}, {x, 0, z + depth}, {x + width, 0, z + depth}, {x + width, 0, z});
}

/// A floor of 4 m by 4 m in texels of a metre, whose triangles on one side come before and on the other after tiles of
/// half a metre that lie in its plane, one within each texel.
struct TilesInFloor {
  scene::PatchScene patches;
  std::vector<Side> sides;

  explicit TilesInFloor(bool both_sides) {
    scene::Material material;
    material.double_sided = both_sides;
    scene::Primitive mesh;
    addFloor(mesh, 0.0, 0.0, 2.0, 4.0);
    for (std::uint32_t i = 0; i < 16; ++i) addFloor(mesh, i % 4 + 0.2, i / 4 + 0.3, 0.5, 0.5);
    addFloor(mesh, 2.0, 0.0, 2.0, 4.0);
    scene::Scene scene;
    scene::test::place(scene, std::move(mesh), glm::dmat4(1.0), material);
    scene::ChartOptions options;
    options.texel_size_m = 1.0;
    auto built = scene::buildPatchScene(scene, options);
    if (!built) ADD_FAILURE() << built.error().text();
    if (built) patches = std::move(*built);
    sides = makeSides(patches);
  }

  /// Whether a leaf of the floor is seen at (x, 0, z), from above or below; of a tile otherwise.
  [[nodiscard]] bool isFloor(const LeafRays& rays, double x, double z, double from) const {
    LeafRays::Place place, end;
    place.position = (glm::dvec3(x, from, z) - patches.centre) / patches.scale;
    place.normal = glm::dvec3(0.0, from > 0.0 ? -1.0 : 1.0, 0.0);
    const auto value = rays.see(place, place.normal, 1, end);
    EXPECT_LT(value, LeafRays::kSkyBelow);
    if (value >= LeafRays::kSkyBelow) return false;
    EXPECT_GT(rays.areaOf(value), 0.0);
    return rays.sideOf(value).width >= 4;
  }
};

TEST(LeafRays, OfWhatLiesInOnePlaceTheEarlierIsSeen) {
  for (const bool both_sides : {false, true}) {
    const TilesInFloor scene(both_sides);
    const LeafRays rays(scene.patches, scene.sides);
    for (const double from : {1.0, -1.0}) {
      if (from < 0.0 && !both_sides) continue;
      for (std::uint32_t i = 0; i < 16; ++i) {
        const double x = i % 4, z = i / 4;
        EXPECT_EQ(scene.isFloor(rays, x + 0.45, z + 0.5, from), x < 2.0) << i;
        EXPECT_TRUE(scene.isFloor(rays, x + 0.1, z + 0.5, from)) << "the same leaf, beside it: " << i;
      }
    }
  }
}

}  // namespace
}  // namespace radiosity::solver
