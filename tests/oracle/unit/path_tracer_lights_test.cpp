// The path tracer's own lamps, sky and coverage, against closed forms.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <initializer_list>
#include <numbers>

#include "tests/oracle/path_tracer.h"

namespace radiosity::oracle {
namespace {

constexpr double kPi = std::numbers::pi;

/// A square of half side `half` at height y that looks up; two triangles.
void addSquare(TriangleScene& scene, double half, double y, const Triangle& like = {}) {
  const glm::dvec3 a(-half, y, -half), b(-half, y, half), c(half, y, half), d(half, y, -half);
  for (const auto& corners : {std::array{a, b, c}, std::array{a, c, d}}) {
    Triangle triangle = like;
    triangle.corners = corners;
    triangle.normal = {0.0, 1.0, 0.0};
    scene.triangles.push_back(triangle);
  }
}

Irradiance at(const TriangleScene& scene, const glm::dvec3& point, std::uint32_t samples = 4096) {
  const auto footprint = Footprint::at(point, {0.0, 1.0, 0.0});
  return PathTracer(scene).irradiance(std::span(&footprint, 1), {.samples = samples})[0];
}

TEST(PathTracerLights, APointLampGivesICosOverSquaredDistance) {
  TriangleScene scene;
  addSquare(scene, 1.0, 0.0);
  scene.lamps.push_back({.position = {0.3, 2.0, 0.4}, .intensity = {8.0, 4.0, 0.0}});
  const double distance2 = 0.09 + 4.0 + 0.16;
  EXPECT_NEAR(at(scene, glm::dvec3(0.0)).mean_lux.x, 8.0 * 2.0 / std::pow(distance2, 1.5), 1e-9);
}

TEST(PathTracerLights, ASpotIsHalfAsBrightSquaredHalfWayDownItsRamp) {
  TriangleScene scene;
  addSquare(scene, 1.0, 0.0);
  const double half_way = 0.5 * (std::cos(0.2) + std::cos(0.6)), angle = std::acos(half_way);
  scene.lamps.push_back({.kind = Lamp::Kind::kSpot,
                         .position = {std::tan(angle), 1.0, 0.0},
                         .direction = {0.0, -1.0, 0.0},
                         .intensity = glm::dvec3(1.0),
                         .inner_rad = 0.2,
                         .outer_rad = 0.6});
  EXPECT_NEAR(at(scene, glm::dvec3(0.0)).mean_lux.x, 0.25 * std::pow(half_way, 3.0), 1e-9);
}

TEST(PathTracerLights, ASunIsHiddenByWhatIsInTheWay) {
  TriangleScene scene;
  addSquare(scene, 1.0, 0.0);
  scene.lamps.push_back({.kind = Lamp::Kind::kSun, .direction = {0.0, -1.0, 0.0}, .intensity = glm::dvec3(7.0)});
  EXPECT_NEAR(at(scene, glm::dvec3(0.0)).mean_lux.x, 7.0, 1e-9);
  addSquare(scene, 0.1, 0.5);
  EXPECT_EQ(at(scene, glm::dvec3(0.0)).mean_lux.x, 0.0);
}

TEST(PathTracerLights, AnOpenPlaneReceivesPiTimesTheUpperSky) {
  TriangleScene scene;
  addSquare(scene, 1.0, 0.0);
  scene.sky_upper = glm::dvec3(3.0);
  scene.sky_lower = glm::dvec3(5.0);
  EXPECT_NEAR(at(scene, glm::dvec3(0.0)).mean_lux.x, 3.0 * kPi, 1e-9);
}

/// Of a sun overhead, through square sheets that lie on each other; beside the edges between their triangles.
double sunThrough(std::initializer_list<double> sheets, double alpha) {
  TriangleScene scene;
  addSquare(scene, 1.0, 0.0);
  Triangle veil;
  veil.see_through = veil.double_sided = true;
  veil.alpha = alpha;
  for (const double half : sheets) addSquare(scene, half, 0.5, veil);
  scene.lamps.push_back({.kind = Lamp::Kind::kSun, .direction = {0.0, -1.0, 0.0}, .intensity = glm::dvec3(1.0)});
  return at(scene, {0.1, 0.0, 0.03}).mean_lux.x;
}

// 4096 looks each: sigma 0.43 / 64 and 0.33 / 64.
TEST(PathTracerLights, ASheetLetsOneMinusItsAlphaThrough) { EXPECT_NEAR(sunThrough({1.0}, 0.25), 0.75, 0.03); }

TEST(PathTracerLights, SheetsThatLieOnEachOtherAllCount) {
  EXPECT_NEAR(sunThrough({1.0, 1.1, 1.2}, 0.5), 0.125, 0.025);
}

TEST(PathTracerLights, AMaskIsAllOrNothing) {
  TriangleScene scene;
  addSquare(scene, 1.0, 0.0);
  Triangle mask;
  mask.see_through = mask.double_sided = true;
  mask.alpha = 0.4;
  mask.cutoff = 0.5;
  addSquare(scene, 1.0, 0.5, mask);
  scene.lamps.push_back({.kind = Lamp::Kind::kSun, .direction = {0.0, -1.0, 0.0}, .intensity = glm::dvec3(1.0)});
  EXPECT_EQ(at(scene, glm::dvec3(0.0), 64).mean_lux.x, 1.0);
  for (auto& triangle : scene.triangles) triangle.alpha = 0.6;
  EXPECT_EQ(at(scene, glm::dvec3(0.0), 64).mean_lux.x, 0.0);
}

}  // namespace
}  // namespace radiosity::oracle
