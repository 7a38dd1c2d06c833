#include "tests/oracle/path_tracer.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/oracle/form_factors.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::oracle {
namespace {

using std::numbers::pi;

/// The mean irradiance over all triangles of a node.
Irradiance meanOverNode(const TriangleScene& scene, const std::string& name, std::uint32_t samples) {
  Footprint footprint;
  for (const auto& triangle : scene.triangles) {
    if (scene.node_names[triangle.node] == name) footprint.pieces.push_back({triangle.corners, triangle.normal});
  }
  return PathTracer(scene).irradiance(std::vector{footprint}, {.samples = samples})[0];
}

void expectWithinFourSigma(const Irradiance& irradiance, double expected, double relative_floor) {
  for (int channel = 0; channel < 3; ++channel) {
    const double tolerance = 4.0 * irradiance.standard_error[channel] + relative_floor * expected;
    EXPECT_NEAR(irradiance.mean_lux[channel], expected, tolerance);
  }
}

TEST(PathTracer, FurnaceIsEvenlyLit) {
  for (const double rho : {0.0, 0.5, 0.9}) {
    const auto scene = triangulate(test_scenes::furnace(glm::dvec3(rho), glm::dvec3(1.0)));
    const auto points = PathTracer(scene).irradiance(
        std::vector{Footprint::at({0.5, 0.0, 0.5}, {0, 1, 0}), Footprint::at({0.01, 0.0, 0.02}, {0, 1, 0})},
        {.samples = 16384});
    for (const auto& point : points) {
      expectWithinFourSigma(point, pi / (1.0 - rho), 1e-6);
      EXPECT_LT(point.standard_error.x, 0.01 * point.mean_lux.x);
      EXPECT_EQ(point.visible_fraction, 1.0);
    }
  }
}

TEST(PathTracer, ParallelAndPerpendicularSquaresHaveTheAnalyticFormFactor) {
  const auto parallel = triangulate(test_scenes::parallelPlates(1, 1, 1, 1 / pi, 0.0));
  expectWithinFourSigma(meanOverNode(parallel, "upper", 1 << 16), 0.1998248957, 1e-5);
  const auto perpendicular = triangulate(test_scenes::perpendicularPlates(1, 1, 1, 1 / pi, 0.0));
  expectWithinFourSigma(meanOverNode(perpendicular, "floor", 1 << 16), 0.2000437761, 1e-5);
}

TEST(PathTracer, PointSeesASquareAsLambertSays) {
  const auto scene = triangulate(test_scenes::parallelPlates(1, 1, 1, 1 / pi, 0.0));
  const auto point =
      PathTracer(scene).irradiance(std::vector{Footprint::at({0.5, 1.0, 0.5}, {0, -1, 0})}, {.samples = 1 << 16})[0];
  expectWithinFourSigma(point, 0.239456, 1e-5);
}

TEST(PathTracer, ConcentricSpheresHaveTheClosedForm) {
  const double r1 = 0.5, rho1 = 0.5, rho2 = 0.6, e1 = pi;
  const auto scene = triangulate(test_scenes::concentricSpheres({r1, rho1, 1.0}, {1.0, rho2, 0.0}, 4));
  // B1 = E1 + rho1 B2; B2 = rho2 (a B1 + (1 - a) B2)
  const double a = r1 * r1;
  const double b2 = rho2 * a * e1 / (1.0 - rho2 * (1.0 - a) - rho2 * a * rho1);
  const double b1 = e1 + rho1 * b2;
  // the facets of the inner sphere see each other's places only as a sphere's would, to the order of their size squared
  expectWithinFourSigma(meanOverNode(scene, "inner", 1 << 16), b2, 5e-3);
  expectWithinFourSigma(meanOverNode(scene, "outer", 1 << 16), a * b1 + (1.0 - a) * b2, 5e-3);
}

TEST(PathTracer, InsideOfASphereMixesAllColours) {
  auto made = test_scenes::concentricSpheres({0.5, 0.5, 1.0}, {1.0, 0.5, 2.0}, 3);
  made.objects.erase(made.objects.begin());
  made.materials[1].reflectance = {0.2, 0.5, 0.8};
  const auto scene = triangulate(made);
  const auto mean = meanOverNode(scene, "outer", 1 << 14);
  for (int channel = 0; channel < 3; ++channel) {
    const double expected = 2.0 * pi / (1.0 - made.materials[1].reflectance[channel]);
    EXPECT_NEAR(mean.mean_lux[channel], expected, 4.0 * mean.standard_error[channel] + 1e-4 * expected);
  }
}

TEST(PathTracer, BacksNeitherShineNorReflect) {
  auto scene = triangulate(test_scenes::furnace(glm::dvec3(0.9), glm::dvec3(1.0)));
  for (auto& triangle : scene.triangles) {
    std::swap(triangle.corners[1], triangle.corners[2]);
    triangle.normal = -triangle.normal;
  }
  const auto point = PathTracer(scene).irradiance(std::vector{Footprint::at({0.5, 0.5, 0.5}, {0, 1, 0})},
                                                  {.samples = 256, .leave_out_buried = false})[0];
  EXPECT_EQ(point.mean_lux, glm::dvec3(0.0));
}

TEST(PathTracer, DoubleSidedSurfacesShineAndReflectBothWays) {
  auto scene = triangulate(test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0)));
  for (auto& triangle : scene.triangles) {
    std::swap(triangle.corners[1], triangle.corners[2]);
    triangle.normal = -triangle.normal;
    triangle.double_sided = true;
  }
  const auto point =
      PathTracer(scene).irradiance(std::vector{Footprint::at({0.5, 0.5, 0.5}, {0, 1, 0})}, {.samples = 16384})[0];
  expectWithinFourSigma(point, 2.0 * pi, 1e-6);
}

TEST(PathTracer, PointsInsideABlockAreLeftOut) {
  const auto scene = triangulate(test_scenes::cornell());
  const PathTracer tracer(scene);
  EXPECT_TRUE(tracer.buried({0.186, 0.0, 0.169}, {0, 1, 0}));   // under the short block
  EXPECT_FALSE(tracer.buried({0.4, 0.0, 0.1}, {0, 1, 0}));      // open floor
  EXPECT_FALSE(tracer.buried({0.2, 0.5488, 0.5}, {0, -1, 0}));  // ceiling
}

TEST(PathTracer, LegsHideTheFloorUnderThem) {
  const auto scene = triangulate(test_scenes::smallRoom());
  const PathTracer tracer(scene);
  EXPECT_TRUE(tracer.buried({2.0 + 0.34, 0.0, 0.74}, {0, 1, 0}));  // under a table's leg, which has no bottom
  EXPECT_FALSE(tracer.buried({2.0, 0.0, 0.0}, {0, 1, 0}));         // under the table
}

/// A room of one metre with a box under its ceiling, of which some faces are left out.
TriangleScene roomWithBoxAbove(glm::dvec3 low, glm::dvec3 high, unsigned left_out) {
  auto made = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0));
  test_scenes::Object box{"box", {}, {}};
  test_scenes::appendBox(box, low, high, test_scenes::allFaces(0), left_out);
  made.objects.push_back(box);
  return triangulate(made);
}

// As light fittings are modelled, half a millimetre below the ceiling: what is above the panel is dark, but no less a
// part of the ceiling.
TEST(PathTracer, BehindALonePanelIsNotInsideASolid) {
  constexpr unsigned kPanel =
      test_scenes::kXMin | test_scenes::kXMax | test_scenes::kYMax | test_scenes::kZMin | test_scenes::kZMax;
  const auto scene = roomWithBoxAbove({0.3, 0.9995, 0.3}, {0.7, 0.9999, 0.7}, kPanel);
  const PathTracer tracer(scene);
  for (const double x : {0.31, 0.5, 0.69}) EXPECT_FALSE(tracer.buried({x, 1.0, 0.52}, {0, -1, 0})) << x;
  const auto result = tracer.irradiance(std::vector{Footprint::at({0.5, 1.0, 0.52}, {0, -1, 0})}, {.samples = 256})[0];
  EXPECT_EQ(result.visible_fraction, 1.0);
  EXPECT_EQ(result.mean_lux, glm::dvec3(0.0));
}

TEST(PathTracer, UnderABoxIsInsideASolidWithOrWithoutItsLid) {
  for (const unsigned left_out : {unsigned{test_scenes::kNoFace}, unsigned{test_scenes::kYMax}}) {
    const PathTracer tracer(roomWithBoxAbove({0.3, 0.99, 0.3}, {0.7, 1.0, 0.7}, left_out));
    EXPECT_FALSE(tracer.buried({0.29, 1.0, 0.52}, {0, -1, 0}));
    for (const double x : {0.301, 0.5, 0.699}) EXPECT_TRUE(tracer.buried({x, 1.0, 0.52}, {0, -1, 0})) << x;
    EXPECT_TRUE(tracer.buried({0.5, 0.995, 0.5}, {0, -1, 0}));  // some surface within
  }
}

// Where half of a box's lid is missing, half of the rays from its bottom get out.
TEST(PathTracer, InAHalfOpenBoxItIsNotDecidedWhatIsInside) {
  auto made = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0));
  test_scenes::Object box{"box", {}, {}};
  test_scenes::appendBox(box, {0.3, 0.0, 0.3}, {0.7, 0.01, 0.7}, test_scenes::allFaces(0), test_scenes::kYMax);
  box.polygons.push_back({{{0.3, 0.01, 0.3}, {0.3, 0.01, 0.7}, {0.5, 0.01, 0.7}, {0.5, 0.01, 0.3}}, 0});
  made.objects.push_back(box);
  const PathTracer tracer(triangulate(made));
  const auto undecidedAt = [&](double x) {
    const auto at = Footprint::at({x, 0.0, 0.52}, {0, 1, 0});
    return tracer.irradiance(std::vector{at}, {.samples = 256})[0].undecided_fraction;
  };
  EXPECT_EQ(undecidedAt(0.35), 0.0);  // under the lid
  EXPECT_EQ(undecidedAt(0.5), 1.0);
  EXPECT_EQ(undecidedAt(0.65), 0.0);
  EXPECT_EQ(undecidedAt(0.2), 0.0);
  EXPECT_TRUE(tracer.buried({0.35, 0.0, 0.52}, {0, 1, 0}));
  EXPECT_FALSE(tracer.buried({0.65, 0.0, 0.52}, {0, 1, 0}));
}

// The gap between a ceiling and a closed box is no part of the box.
TEST(PathTracer, BetweenACeilingAndABoxIsNotInsideIt) {
  const PathTracer tracer(roomWithBoxAbove({0.3, 0.9, 0.3}, {0.7, 0.9995, 0.7}, test_scenes::kNoFace));
  EXPECT_FALSE(tracer.buried({0.5, 1.0, 0.52}, {0, -1, 0}));
}

// What lies in a hollow of itself looks at itself along its surface: a bowl inside a block.
TEST(PathTracer, AHollowSurfaceInsideABlockIsInsideIt) {
  auto made = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0));
  test_scenes::Object things{"things", {}, {}};
  test_scenes::appendBox(things, {0.2, 0.0, 0.2}, {0.8, 0.6, 0.8}, test_scenes::allFaces(0), test_scenes::kYMin);
  made.objects.push_back(things);
  test_scenes::Object bowl{"bowl", {}, {}};
  bowl.polygons = {{{{0.4, 0.3, 0.4}, {0.4, 0.2, 0.6}, {0.6, 0.2, 0.6}, {0.6, 0.3, 0.4}}, 0},
                   {{{0.4, 0.2, 0.6}, {0.4, 0.3, 0.7}, {0.6, 0.3, 0.7}, {0.6, 0.2, 0.6}}, 0}};
  made.objects.push_back(bowl);
  const auto scene = triangulate(made);
  const auto& facet = scene.triangles[scene.triangles.size() - 4];
  const auto middle = (facet.corners[0] + facet.corners[1] + facet.corners[2]) / 3.0;
  EXPECT_TRUE(PathTracer(scene).buried(middle, facet.normal));
}

TEST(PathTracer, OfTwoFacesInOnePlaneTheLaterIsLeftOut) {
  auto made = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0));
  test_scenes::Object mat{"mat", {}, {}};  // on a quarter of the floor, once upwards and once downwards
  mat.polygons = {{{{0.5, 0.0, 0.5}, {0.5, 0.0, 1.0}, {1.0, 0.0, 1.0}, {1.0, 0.0, 0.5}}, 0},
                  {{{0.0, 0.0, 0.0}, {0.5, 0.0, 0.0}, {0.5, 0.0, 0.5}, {0.0, 0.0, 0.5}}, 0}};
  made.objects.push_back(mat);
  const auto scene = triangulate(made);
  std::vector<Footprint> footprints;
  for (std::uint32_t t = 0; t < scene.triangles.size(); ++t)
    footprints.push_back({{{scene.triangles[t].corners, scene.triangles[t].normal, t}}});
  const auto results = PathTracer(scene).irradiance(footprints, {.samples = 64});
  const auto mats = results.size() - 4;
  for (std::size_t t = 0; t < mats; ++t) EXPECT_EQ(results[t].visible_fraction, 1.0) << t;
  for (std::size_t t = mats; t < mats + 2; ++t) EXPECT_EQ(results[t].visible_fraction, 0.0) << t;

  // The other side of such a face is seen, and judged by itself.
  for (const auto t : {mats, mats + 2}) {
    const Footprint back{{{scene.triangles[t].corners, -scene.triangles[t].normal}}};
    EXPECT_EQ(PathTracer(scene).irradiance(std::vector{back}, {.samples = 64})[0].visible_fraction, 1.0) << t;
  }
}

TEST(PathTracer, FootprintHalfUnderABlockReportsHalf) {
  auto made = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0), 4.0);
  test_scenes::Object block{"block", {}, {}};
  test_scenes::appendBox(block, {1, 0, 1}, {2, 1, 2}, test_scenes::allFaces(0), test_scenes::kYMin);
  made.objects.push_back(block);
  const auto scene = triangulate(made);
  const Footprint half{{{{glm::dvec3{0.8, 0, 1.4}, {0.8, 0, 1.6}, {1.2, 0, 1.6}}, {0, 1, 0}},
                        {{glm::dvec3{0.8, 0, 1.4}, {1.2, 0, 1.6}, {1.2, 0, 1.4}}, {0, 1, 0}}}};
  const auto result = PathTracer(scene).irradiance(std::vector{half}, {.samples = 8192})[0];
  EXPECT_NEAR(result.visible_fraction, 0.5, 0.01);
  expectWithinFourSigma(result, 2.0 * pi, 1e-6);
}

TEST(PathTracer, SameSeedGivesTheSameBitsOnAnyNumberOfThreads) {
  const auto scene = triangulate(test_scenes::cornell());
  std::vector<Footprint> points;
  for (int i = 0; i < 20; ++i) points.push_back(Footprint::at({0.02 + 0.02 * i, 0.0, 0.05}, {0, 1, 0}));
  const PathTracer tracer(scene);
  const auto one = tracer.irradiance(points, {.samples = 64, .threads = 1});
  const auto three = tracer.irradiance(points, {.samples = 64, .threads = 3});
  for (std::size_t i = 0; i < points.size(); ++i) EXPECT_EQ(one[i].mean_lux, three[i].mean_lux);
}

TEST(PathTracer, StandardErrorIsCalibrated) {
  const auto scene = triangulate(test_scenes::cornell());
  const PathTracer tracer(scene);
  const std::vector points(400, Footprint::at({0.4, 0.0, 0.1}, {0, 1, 0}));  // the same point with 400 seeds
  const auto results = tracer.irradiance(points, {.samples = 128});
  double mean = 0.0, square = 0.0, stated = 0.0;
  for (const auto& result : results) {
    mean += result.mean_lux.x / 400;
    square += result.mean_lux.x * result.mean_lux.x / 400;
    stated += result.standard_error.x * result.standard_error.x / 400;
  }
  EXPECT_NEAR(std::sqrt(stated / (square - mean * mean)), 1.0, 0.2);
}

}  // namespace
}  // namespace radiosity::oracle
