// What a stranger sees in a scene: textures that shine, both sides of a wall, smooth normals, and what rays meet first.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/oracle/form_factors.h"
#include "tests/oracle/path_tracer.h"
#include "tests/oracle/surface_finder.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::oracle {
namespace {

using std::numbers::pi;

Texture blackAndWhite() {
  Texture texture{std::make_shared<const Image>(Image{2, 1, {0, 0, 0, 255, 255, 255, 255, 255}})};
  texture.nearest = true;
  return texture;
}

// The picture is black in its left half and white in its right one: the light of half the square, in closed form.
TEST(EmissiveTexture, ShinesWhereItsPictureIsBright) {
  auto scene = triangulate(test_scenes::parallelPlates(1, 1, 1, 1 / pi, 0.0));
  scene.textures.push_back(blackAndWhite());
  for (auto& triangle : scene.triangles) {
    if (triangle.emission_lux == glm::dvec3(0.0)) continue;
    triangle.emissive.texture = 0;
    for (std::size_t k = 0; k < 3; ++k) triangle.emissive.uv[k] = {triangle.corners[k].x, triangle.corners[k].z};
  }
  const std::vector<glm::dvec3> bright{{0.5, 0, 0}, {0.5, 0, 1}, {1, 0, 1}, {1, 0, 0}};
  const PathTracer tracer(scene);
  for (const glm::dvec3 point : {glm::dvec3(0.5, 1.0, 0.5), glm::dvec3(0.1, 1.0, 0.3)}) {
    const auto traced = tracer.irradiance(std::vector{Footprint::at(point, {0, -1, 0})}, {.samples = 1 << 16})[0];
    const double exact = pointToPolygon(point, {0, -1, 0}, bright);
    EXPECT_NEAR(traced.mean_lux.x, exact, 4.0 * traced.standard_error.x + 1e-5);
    EXPECT_LT(traced.standard_error.x, 0.01 * exact);
  }
}

// A room of two halves whose walls shine with 1 nit in one of them and are black in all: the side of the partition that
// looks into the bright half receives pi, the other nothing, and no place has their mean.
TEST(BothSides, OfAPartitionLitOnOneSideAreBrightAndBlack) {
  test_scenes::TestScene made;
  const auto shining = made.add({"shining", glm::dvec3(0.0), glm::dvec3(1.0)});
  const auto black = made.add({"black", glm::dvec3(0.0), glm::dvec3(0.0)});
  const auto wall = made.add({"wall", glm::dvec3(0.0), glm::dvec3(0.0), 1.0, true});
  test_scenes::Object room{"room", {}, {}};
  test_scenes::appendBox(room, {0, 0, 0}, {1, 1, 1}, test_scenes::allFaces(shining), test_scenes::kXMax, true);
  test_scenes::appendBox(room, {1, 0, 0}, {2, 1, 1}, test_scenes::allFaces(black), test_scenes::kXMin, true);
  room.polygons.push_back({{{1, 0, 0}, {1, 1, 0}, {1, 1, 1}, {1, 0, 1}}, wall});
  made.objects.push_back(room);
  const auto sides = PathTracer(triangulate(made))
                         .irradiance(std::vector{Footprint::at({1.0, 0.4, 0.3}, {-1, 0, 0}),
                                                 Footprint::at({1.0, 0.4, 0.3}, {1, 0, 0})},
                                     {.samples = 4096});
  EXPECT_NEAR(sides[0].mean_lux.x, pi, 4.0 * sides[0].standard_error.x + 1e-6);
  EXPECT_EQ(sides[1].mean_lux, glm::dvec3(0.0));
}

// The front of a wall and a flipped copy of another material in one place: a ray meets one of them by chance, and has
// met the one that faces it. Under a sky of 1 nit: pi on the floor, where the wall beside it is white and shines as
// much.
TEST(BothSides, OfTwoFacesInOnePlaceThatOneIsMetThatFacesTheRay) {
  test_scenes::TestScene made;
  const auto shining = made.add({"shining", glm::dvec3(0.0), glm::dvec3(1.0)});
  const auto black = made.add({"black", glm::dvec3(0.0), glm::dvec3(0.0)});
  test_scenes::Object wall{"wall", {}, {}};
  wall.polygons = {{{{0, 0, -9}, {0, 9, -9}, {0, 9, 9}, {0, 0, 9}}, shining},
                   {{{0, 9, 9}, {0, 9, -9}, {0, 0, -9}, {0, 0, 9}}, black}};
  made.objects.push_back(wall);
  made.sky_upper_nits = glm::dvec3(1.0);
  for (const bool late : {false, true}) {
    if (late) std::swap(made.objects[0].polygons[0], made.objects[0].polygons[1]);
    const auto scene = triangulate(made);
    const double side = scene.triangles[late ? 2 : 0].normal.x;  // which the shining front looks at
    const auto lux = PathTracer(scene).irradiance(std::vector{Footprint::at({0.5 * side, 0.0, 0.0}, {0, 1, 0}),
                                                              Footprint::at({-0.5 * side, 0.0, 0.0}, {0, 1, 0})},
                                                  {.samples = 4096, .leave_out_buried = false});
    EXPECT_NEAR(lux[0].mean_lux.x, pi, 4.0 * lux[0].standard_error.x + 1e-6);
    // The wall hides nearly half of the sky: all but what passes beside and above it.
    EXPECT_NEAR(lux[1].mean_lux.x, 0.5 * pi, 0.05 * pi);
  }
}

TriangleScene planeUnder(const Lamp& lamp) {
  TriangleScene scene;
  Triangle triangle;
  triangle.corners = {glm::dvec3(-1, 0, -1), {-1, 0, 1}, {1, 0, 1}};
  triangle.normal = {0, 1, 0};
  scene.triangles.push_back(triangle);
  scene.lamps.push_back(lamp);
  return scene;
}

Footprint shadedAt(const glm::dvec3& shading) {
  auto footprint = Footprint::at({-0.4, 0.0, 0.2}, {0, 1, 0});
  footprint.pieces[0].shading = {shading, shading, shading};
  return footprint;
}

TEST(ShadingNormal, WeighsLightAndThePlaneStillHidesIt) {
  const auto along = [](const glm::dvec3& way) {
    return Lamp{.kind = Lamp::Kind::kSun, .direction = glm::normalize(way), .intensity = glm::dvec3(7.0)};
  };
  const auto tilted = glm::normalize(glm::dvec3(1, 1, 0));
  const auto lux = [&](const Lamp& lamp, const glm::dvec3& shading) {
    return PathTracer(planeUnder(lamp)).irradiance(std::vector{shadedAt(shading)}, {.samples = 64})[0].mean_lux.x;
  };
  EXPECT_NEAR(lux(along({-1, -1, 0}), tilted), 7.0, 1e-9);
  EXPECT_NEAR(lux(along({0, -1, 0}), tilted), 7.0 * std::sqrt(0.5), 1e-9);
  EXPECT_NEAR(lux(along({-1, 0.2, 0}), tilted), 0.0, 1e-12);   // from below the plane, before the shading normal
  EXPECT_NEAR(lux(along({0, -1, 0}), {0, -1, 0}), 7.0, 1e-9);  // one that turns away: the geometric one
  EXPECT_NEAR(lux(along({0, -1, 0}), glm::dvec3(0.0)), 7.0, 1e-9);
}

// Of the hemisphere about a normal that leans by t, the part above the plane, weighed by its cosine, is (1 + cos t)
// / 2.
TEST(ShadingNormal, UnderASkyLosesWhatIsBelowThePlane) {
  auto scene = planeUnder({});
  scene.lamps.clear();
  scene.sky_upper = glm::dvec3(1.0);
  scene.sky_lower = glm::dvec3(9.0);
  const auto sky =
      PathTracer(scene).irradiance(std::vector{shadedAt(glm::normalize(glm::dvec3(1, 1, 0)))}, {.samples = 1 << 14})[0];
  EXPECT_NEAR(sky.mean_lux.x, pi * 0.5 * (1.0 + std::sqrt(0.5)), 4.0 * sky.standard_error.x + 1e-4);
}

TEST(FirstRays, TellWhatIsInASolidAndWhatIsInTheOpen) {
  auto made = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0));
  test_scenes::Object box{"box", {}, {}};
  test_scenes::appendBox(box, {0.3, 0.0, 0.3}, {0.7, 0.2, 0.7}, test_scenes::allFaces(0), test_scenes::kYMin);
  made.objects.push_back(box);
  const auto results =
      PathTracer(triangulate(made))
          .irradiance(std::vector{Footprint::at({0.5, 0.0, 0.5}, {0, 1, 0}), Footprint::at({0.1, 0.0, 0.5}, {0, 1, 0}),
                                  Footprint::at({0.1, 0.0, 0.5}, {0, -1, 0})},
                      {.samples = 256, .leave_out_buried = false});
  EXPECT_EQ(results[0].back_fraction, 1.0);
  EXPECT_EQ(results[0].mean_lux, glm::dvec3(0.0));
  EXPECT_EQ(results[1].back_fraction, 0.0);
  EXPECT_EQ(results[1].open_fraction, 0.0);
  EXPECT_EQ(results[2].open_fraction, 1.0);
}

/// Three squares of side 2: one, its flipped copy in the same place, and one a hair (but a tenth of the reach) above.
TriangleScene sheets() {
  TriangleScene scene;
  const auto add = [&](double y, bool up) {
    Triangle triangle;
    const glm::dvec3 a(-1, y, -1), b(-1, y, 1), c(1, y, 1);
    triangle.corners = up ? std::array{a, b, c} : std::array{a, c, b};
    triangle.normal = {0, up ? 1 : -1, 0};
    scene.triangles.push_back(triangle);
  };
  add(0.0, true), add(0.0, false), add(2e-5, true);
  return scene;
}

TEST(SurfaceFinder, TakesTheFrontThatIsNearestAndABackOnlyWhereThereIsNoFront) {
  const auto scene = sheets();
  const SurfaceFinder finder(scene);
  const glm::dvec3 below(-0.5, 0.0, 0.2), above(-0.5, 2e-5, 0.2);
  EXPECT_EQ(finder.find(below, {0, 1, 0})->triangle, 0U);
  EXPECT_EQ(finder.find(below, {0, -1, 0})->triangle, 1U);
  EXPECT_EQ(finder.find(above, {0, 1, 0})->triangle, 2U);
  auto one = scene;
  one.triangles.resize(1);
  const auto behind = SurfaceFinder(one).find(below, {0, -1, 0});
  ASSERT_TRUE(behind);
  EXPECT_TRUE(behind->back);
  EXPECT_FALSE(finder.find({-0.5, 0.1, 0.2}, {0, 1, 0}));
}

TEST(SurfaceFinder, WeighsCornersByWhereThePointLies) {
  const auto scene = sheets();
  const auto hit = SurfaceFinder(scene).find({-0.5, 0.0, 0.2}, {0, 1, 0});
  ASSERT_TRUE(hit);
  const auto& [a, b, c] = scene.triangles[0].corners;
  EXPECT_LT(glm::distance(a * (1.0 - hit->u - hit->v) + b * hit->u + c * hit->v, glm::dvec3(-0.5, 0.0, 0.2)), 1e-6);
}

TEST(JoinSides, MakesAFrontAndItsFlippedCopyOneSurface) {
  auto scene = sheets();
  auto joined = joinSides(scene);
  ASSERT_EQ(joined.triangles.size(), 2U);
  EXPECT_TRUE(joined.triangles[0].double_sided);
  EXPECT_FALSE(joined.triangles[1].double_sided);
  EXPECT_EQ(matchTriangles(scene, joined), (std::vector<std::uint32_t>{0, 0, 1}));
  scene.triangles[1].reflectance = glm::dvec3(0.5);  // another material: not its copy
  EXPECT_EQ(joinSides(scene).triangles.size(), 3U);
}

}  // namespace
}  // namespace radiosity::oracle
