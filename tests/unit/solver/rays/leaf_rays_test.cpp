// Which leaf a ray sees where surfaces lie on each other.
#include "server/solver/rays/leaf_rays.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <random>

#include "server/scene/charts/build.h"
#include "tests/unit/scene/shapes.h"
#include "tests/unit/solver/quad_scene.h"

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
    EXPECT_LT(value, LeafRays::kSky);
    if (value >= LeafRays::kSky) return false;
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

/// Whose distances single precision knows worse than rays are lifted.
TEST(LeafRays, LongThinTurnedStripsDoNotHideTheSkyFromThemselves) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto direction = [&] {
    return glm::normalize(2.0 * glm::dvec3(unit(random), unit(random), unit(random)) - 1.0);
  };
  std::size_t hidden = 0, hidden_there = 0, seen = 0;
  for (int turn = 0; turn < 50; ++turn) {
    const glm::dvec3 along = direction(), across = glm::normalize(glm::cross(along, direction()));
    constexpr double kLong = 0.8, kWide = kLong / 400.0;
    const glm::dvec3 corner = -0.5 * (kLong * along + kWide * across);
    const auto made =
        test::makeQuadScene({{glm::vec3(corner), glm::vec3(kLong * along), glm::vec3(kWide * across), 40, 1}});
    const auto sides = makeSides(*made.patches);
    const LeafRays rays(*made.patches, sides);
    const auto seesSky = [&](const LeafRays::Place& from, const glm::dvec3& way) {
      LeafRays::Place end;
      const auto seen = rays.see(from, way, 1, end);
      return LeafRays::isSky(seen);
    };
    for (int i = 0; i < 2'000; ++i) {
      const auto place = rays.placeOn(static_cast<std::uint32_t>(i % 40), {unit(random), unit(random)});
      LeafRays::Place end;
      const auto way = cosineDirection(place.normal, unit(random), unit(random));
      hidden += seesSky(place, way) ? 0 : 1;
      const LeafRays::Place before{place.position + 0.3 * way, -way};
      if (rays.see(before, -way, 1, end) >= LeafRays::kSky) continue;
      ++seen;
      const auto on = cosineDirection(end.normal, unit(random), unit(random));
      hidden_there += seesSky(end, on) ? 0 : 1;
    }
  }
  EXPECT_GT(seen, 90'000U) << "of 100,000";
  // Of two triangles the other may be met, right at the edge between them.
  EXPECT_LT(hidden, 20U);
  EXPECT_LT(hidden_there, 20U);
}

// Who asks where a ray ends that is known to end on a leaf saves looking for it.
TEST(LeafRays, EndWhereTheyAreSeenToEndWhereAllNormalsAreTheSame) {
  const auto made = test::makeQuadScene(test::cubeQuads(8, test::kDark, test::kGrey));
  const auto sides = makeSides(*made.patches);
  const LeafRays rays(*made.patches, sides);
  auto bent = *made.patches;  // within what is flat in a file
  bent.triangles[bent.surfaces[0].first_triangle].normal.x += 1e-6F;
  const LeafRays of_bent(bent, sides);
  std::mt19937 random(3);
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::size_t known = 0, flat = 0, asked = 0;
  for (std::uint32_t value = 0; value < 6 * 64; ++value) {
    for (int i = 0; i < 20; ++i, ++asked) {
      const auto place = rays.placeOn(value, {uniform(random), uniform(random)});
      const auto direction = cosineDirection(place.normal, uniform(random), uniform(random));
      const auto sight = rays.look(place, direction);
      ASSERT_LT(sight.end.value, LeafRays::kSky);
      const auto end = rays.endOn(sight.end.value, place, direction);
      flat += glm::dot(sight.end.normal, direction) > -0.05 ? 1 : 0;
      if (!end) continue;
      ++known;
      EXPECT_LT(glm::distance(end->position, sight.end.position), 2e-6);
      EXPECT_EQ(end->normal, sight.end.normal);
      EXPECT_EQ(of_bent.endOn(sight.end.value, place, direction).has_value(), sides[sight.end.value / 64].surface != 0);
    }
  }
  EXPECT_EQ(known + flat, asked) << "all but those that hardly meet the plane";
  EXPECT_GT(known, 9 * asked / 10);
}

}  // namespace
}  // namespace radiosity::solver
