#include "tests/oracle/dense_solver.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "tests/oracle/path_tracer.h"
#include "tests/scenes/scenes.h"

namespace radiosity::oracle {
namespace {

constexpr double kWhole = std::numeric_limits<double>::infinity();

/// Six faces of the unit cube with the closed-form factors.
FormFactorMatrix cubeFactors() {
  const double opposite = parallelRectangles(1, 1, 1);
  FormFactorMatrix factors(36, (1.0 - opposite) / 4.0);
  for (std::size_t i = 0; i < 6; ++i) {
    factors[i * 6 + i] = 0.0;
    factors[i * 6 + (i ^ 1U)] = opposite;  // faces come in pairs: -x +x -y +y -z +z
  }
  return factors;
}

TEST(DenseSolver, LumpedUnitCubeHasTheKnownValues) {
  const auto half = makePatches(test_scenes::lumpedCube(0.5), kWhole);
  ASSERT_EQ(half.size(), 6U);
  const auto b5 = solveDense(half, cubeFactors()).radiosity_lux;
  EXPECT_NEAR(b5[2].x, 1.0909090981, 1e-10);
  EXPECT_NEAR(b5[3].x, 0.1817458261, 1e-10);
  EXPECT_NEAR(b5[0].x, 0.1818362689, 1e-10);
  const auto b9 = solveDense(makePatches(test_scenes::lumpedCube(0.9), kWhole), cubeFactors()).radiosity_lux;
  EXPECT_NEAR(b9[2].y, 2.3728813748, 1e-9);
  EXPECT_NEAR(b9[3].y, 1.5253105511, 1e-9);
  EXPECT_NEAR(b9[4].y, 1.5254520185, 1e-9);
}

TEST(DenseSolver, IntegratedFactorsOfTheCubeAreTheClosedForms) {
  const auto factors = formFactors(makePatches(test_scenes::lumpedCube(0.5), kWhole));
  const auto exact = cubeFactors();
  for (std::size_t i = 0; i < factors.size(); ++i) EXPECT_NEAR(factors[i], exact[i], 1e-6) << i;
}

TEST(DenseSolver, RowsOfAClosedRoomSumToOne) {
  const auto patches = makePatches(test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0)), 0.4);
  const auto factors = formFactors(patches);
  for (std::size_t i = 0; i < patches.size(); ++i) {
    double sum = 0.0;
    for (std::size_t j = 0; j < patches.size(); ++j) sum += factors[i * patches.size() + j];
    EXPECT_NEAR(sum, 1.0, 1e-5);
  }
}

TEST(DenseSolver, FurnaceConvergesToItsClosedFormUpToReflectance9999) {
  for (const double rho : {0.5, 0.9, 0.9999}) {
    const auto patches = makePatches(test_scenes::furnace(glm::dvec3(rho), glm::dvec3(1.0)), kWhole);
    for (const auto& b : solveDense(patches, cubeFactors()).radiosity_lux) {
      EXPECT_NEAR(b.x * (1.0 - rho) / std::numbers::pi, 1.0, 1e-8);
    }
  }
}

TEST(DenseSolver, WidePlatesApproachInfinitePlates) {
  const double e1 = std::numbers::pi, rho = 0.5;
  const auto patches = makePatches(test_scenes::parallelPlates(1e4, 1e4, 1, 1.0, rho), kWhole);
  const auto b = solveDense(patches, formFactors(patches)).radiosity_lux;
  EXPECT_NEAR(b[0].x, e1 / (1.0 - rho * rho), 2e-3);
  EXPECT_NEAR(b[1].x, rho * e1 / (1.0 - rho * rho), 2e-3);
}

TEST(DenseSolver, AgreesWithThePathTracerInTheLumpedCubeCutFine) {
  const auto scene = test_scenes::lumpedCube(0.5);
  const auto patches = makePatches(scene, 0.2);
  const auto solution = solveDense(patches, formFactors(patches, {}, {1e-5, 4}));
  std::vector<Footprint> footprints;
  for (const auto& patch : patches) {
    const auto& c = patch.corners;
    const auto n = unitNormal(c);
    footprints.push_back({{{{c[0], c[1], c[2]}, n}, {{c[0], c[2], c[3]}, n}}});
  }
  const auto traced = PathTracer(triangulate(scene)).irradiance(footprints, {.samples = 2048});
  for (std::size_t i = 0; i < patches.size(); ++i) {
    // 3 %: radiosity is constant on a patch here
    const double tolerance = 4.0 * traced[i].standard_error.x + 0.03 * traced[i].mean_lux.x;
    EXPECT_NEAR(solution.irradiance_lux[i].x, traced[i].mean_lux.x, tolerance) << i;
  }
}

TEST(DenseSolver, AgreesWithThePathTracerInTheCornellBox) {
  const auto scene = test_scenes::cornell();
  const auto patches = makePatches(scene, 0.14);
  const auto solution = solveDense(patches, formFactors(patches, allPolygons(scene), {0.0, 0}));
  std::vector<Footprint> footprints;
  for (const auto& patch : patches) {
    const auto n = unitNormal(patch.corners);
    Footprint footprint;
    for (std::size_t i = 1; i + 1 < patch.corners.size(); ++i) {
      footprint.pieces.push_back({{patch.corners[0], patch.corners[i], patch.corners[i + 1]}, n});
    }
    footprints.push_back(footprint);
  }
  const auto traced = PathTracer(triangulate(scene)).irradiance(footprints, {.samples = 1024});
  double error = 0.0, total = 0.0, mean_dense = 0.0, mean_traced = 0.0;
  for (std::size_t i = 0; i < patches.size(); ++i) {
    if (traced[i].visible_fraction < 0.999) continue;  // the dense solver averages over buried ground too
    const double a = area(patches[i].corners);
    const double difference = solution.irradiance_lux[i].y - traced[i].mean_lux.y;
    error += a * difference * difference;
    total += a * traced[i].mean_lux.y * traced[i].mean_lux.y;
    mean_dense += a * solution.irradiance_lux[i].y;
    mean_traced += a * traced[i].mean_lux.y;
  }
  EXPECT_LT(std::sqrt(error / total), 0.04);
  EXPECT_NEAR(mean_dense / mean_traced, 1.0, 0.015);
}

}  // namespace
}  // namespace radiosity::oracle
