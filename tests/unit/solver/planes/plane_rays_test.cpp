// Light at the points of a plane, against closed forms; and stated standard errors, against how estimates scatter.
#include "server/solver/planes/plane_rays.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/solver/planes/plane_figures.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using std::numbers::pi;

/// One unit across, level, at y = -0.2, in the unit box.
PlaneGrid levelGrid(std::uint32_t columns, std::uint32_t rows) {
  return {{-0.5, -0.2, -0.5}, {1.0, 0.0, 0.0}, {0.0, 0.0, 1.0}, {0.0, 1.0, 0.0}, columns, rows};
}

test::Quad floor(float reflectance = 0.0F) {
  test::Quad quad{{-0.5F, -0.4F, 0.5F}, {1.0F, 0.0F, 0.0F}, {0.0F, 0.0F, -1.0F}};
  quad.reflectance = glm::vec3(reflectance);
  return quad;
}

test::Quad lamp(float emission) {
  test::Quad quad{{-0.1F, 0.4F, -0.1F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.0F, 0.2F}};
  quad.width = quad.height = 1;
  quad.emission = glm::vec3(emission);
  return quad;
}

class PlaneRaysTest : public testing::Test {
 protected:
  PlaneRaysTest() : PlaneRaysTest({floor()}) {}
  explicit PlaneRaysTest(const std::vector<test::Quad>& quads) : scene_(test::makeQuadScene(quads)) {
    irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(0.0F));
  }
  [[nodiscard]] PlaceLight light() const {
    return PlaceLight({*scene_.patches, nullptr, nullptr, scene_.materials, sources_, irradiance_, difference_});
  }
  [[nodiscard]] static PlaneResult figures(const PlaceLight& light, const PlaneGrid& grid, std::uint64_t key = 1) {
    PlaneRays rays(light, grid, key);
    rays.measure(0.01);
    return planeFigures(rays, 0.0, {});
  }

  test::QuadScene scene_;
  std::vector<glm::vec3> irradiance_, difference_;
  LightSources sources_;
};

// E = I cos^3 / h^2.
TEST_F(PlaneRaysTest, UnderAPointLampHaveTheInverseSquareAndTheCosine) {
  scene::PunctualLight point;
  const double scale = scene_.patches->scale;
  point.position = scene_.patches->centre + scale * glm::dvec3(0.1, 0.3, 0.0);
  point.intensity = glm::vec3(200.0F);
  sources_.lights = {point};
  const auto grid = levelGrid(7, 5);
  const auto found = figures(light(), grid);
  for (std::size_t i = 0; i < grid.pointCount(); ++i) {
    const auto way = scale * (glm::dvec3(0.1, 0.3, 0.0) - grid.pointAt(i));
    const double expected = 200.0 * way.y / std::pow(glm::length(way), 3.0);
    EXPECT_NEAR(found.light[i], expected, 1e-5 * expected) << i;
    EXPECT_NEAR(found.error[i], 0.0, 1e-6 * expected) << "nothing is drawn by chance";
  }
  EXPECT_NEAR(found.figures.maximum, *std::ranges::max_element(found.light), 1e-4);
  EXPECT_NEAR(found.figures.minimum, *std::ranges::min_element(found.light), 1e-4);
}

// A disc of radiance L over its middle: E = pi L r^2 / (r^2 + h^2).
TEST_F(PlaneRaysTest, UnderADiscHaveTheFormFactorOfADisc) {
  scene::PunctualLight disc;
  const double scale = scene_.patches->scale;
  disc.kind = scene::LightKind::kDisc;
  disc.position = scene_.patches->centre + scale * glm::dvec3(0.0, 0.3, 0.0);
  disc.direction = {0.0, -1.0, 0.0};
  disc.intensity = glm::vec3(100.0F);
  disc.half = {0.2 * scale, 0.2 * scale};
  sources_.lights = {disc};
  const auto found = figures(light(), levelGrid(1, 1));
  const double expected = pi * 100.0 * 0.04 / (0.04 + 0.25);
  EXPECT_NEAR(found.figures.mean, expected, 1e-3 * expected);
}

class PlaneUnderALamp : public PlaneRaysTest {
 protected:
  PlaneUnderALamp() : PlaneRaysTest({floor(), lamp(50.0F)}) {}
};

// A rectangle a x b over its corner, parallel: F = (A atan(B) + B' atan(A')) / (2 pi) of Howell's catalogue, C-13.
TEST_F(PlaneUnderALamp, HasTheFormFactorOfARectangle) {
  const double side = 0.1 / 0.6, root = std::sqrt(1.0 + side * side);
  const double quarter = 2.0 * side / root * std::atan(side / root) / (2.0 * pi);
  const auto found = figures(light(), levelGrid(1, 1));
  EXPECT_NEAR(found.figures.mean, 50.0 * 4.0 * quarter, 1e-4 * found.figures.mean);
}

TEST_F(PlaneUnderALamp, FromBelowSeesNothingOfIt) {
  auto grid = levelGrid(3, 3);
  grid.normal = -grid.normal;
  EXPECT_EQ(figures(light(), grid).figures.mean, 0.0);
}

// Whatever its albedo the floor sends B = rho H, which fills the lower half of what a plane that faces it sees near it.
TEST_F(PlaneRaysTest, FacingALitFloorHaveItsRadiosity) {
  scene_ = test::makeQuadScene({floor(0.5F)});
  irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(80.0F));
  const auto low = light();
  PlaneGrid grid{{-0.001, -0.399, -0.001}, {0.002, 0.0, 0.0}, {0.0, 0.0, 0.002}, {0.0, -1.0, 0.0}, 2, 2};
  EXPECT_NEAR(figures(low, grid).figures.mean, 40.0, 0.01);
  EXPECT_NEAR(figures(low, grid).figures.uniformity, 1.0, 1e-3);
}

TEST_F(PlaneUnderALamp, TheSameKeyGivesTheSameBits) {
  irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(3.0F));
  const auto lit = light();
  EXPECT_EQ(figures(lit, levelGrid(9, 7)).light, figures(lit, levelGrid(9, 7)).light);
}

class PlaneOverAChequeredFloor : public PlaneRaysTest {
 protected:
  PlaneOverAChequeredFloor() : PlaneRaysTest({floor(0.6F), lamp(50.0F), plate()}) {
    for (std::size_t n = 0; n < irradiance_.size(); ++n) irradiance_[n] = glm::vec3(n % 2 == 0 ? 100.0F : 5.0F);
  }
  /// Hides the lamp from a part of the plane.
  static test::Quad plate() {
    test::Quad quad{{-0.1F, 0.1F, -0.1F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.0F, 0.2F}};
    quad.width = quad.height = 1;
    return quad;
  }
};

// Chi-square: the squares of what points are off by, over the squares of their stated errors, are about 1 in the mean,
// or less, since a point's error is that of its neighbours where theirs is larger. Over 40 seeds of 25 points each the
// mean of that is known to some 5 %.
TEST_F(PlaneOverAChequeredFloor, StatedErrorsAreWhatPointsAreOffBy) {
  const auto lit = light();
  auto grid = levelGrid(5, 5);
  grid.normal = glm::normalize(glm::dvec3(0.9, 0.2, 0.4));  // sees floor and lamp
  std::vector<double> truth(grid.pointCount(), 0.0);
  constexpr int kSeeds = 40, kOfTruth = 400;
  double mean_truth = 0.0;
  PlaneRays many(lit, grid, 999);
  for (int i = 0; i < kOfTruth; ++i) many.addRounds();
  const auto exact = planeFigures(many, 0.0, {});
  mean_truth = exact.figures.mean;
  double square = 0.0, of_mean = 0.0, least = 0.0, count = 0.0, beyond = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    PlaneRays rays(lit, grid, seed);
    while (rays.rounds() < PlaneRays::kLeastRounds) rays.addRounds();
    const auto found = planeFigures(rays, 0.0, {});
    for (std::size_t i = 0; i < grid.pointCount(); ++i) {
      if (!(found.error[i] > 0.0)) continue;
      const double off = (found.light[i] - exact.light[i]) / found.error[i];
      square += off * off;
      beyond += std::abs(off) > 2.131 ? 1.0 : 0.0;
      count += 1.0;
    }
    of_mean += std::pow((found.figures.mean - mean_truth) / found.figures.mean_error, 2.0) / kSeeds;
    least += found.figures.minimum / kSeeds;
  }
  EXPECT_GT(count, 0.9 * kSeeds * 25);
  EXPECT_NEAR(square / count, 0.95, 0.25);
  EXPECT_LT(beyond / count, 0.055) << "5 % of Student's t with 15 degrees of freedom";
  EXPECT_GT(of_mean, 0.5);
  EXPECT_LT(of_mean, 2.2);
  const double darkest = *std::ranges::min_element(exact.light);
  EXPECT_GT(least, darkest * 0.99) << "the minimum of noisy points is not biased low";
}

// Halves of a solve that differ by 10 everywhere are each off by some 5 where light is reflected, and so is the plane.
TEST_F(PlaneRaysTest, WhatHalvesOfTheSolveDifferByIsInTheStatedError) {
  scene_ = test::makeQuadScene({floor(0.5F)});
  irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(80.0F));
  difference_.assign(scene_.patches->nodeCount(), glm::vec3(10.0F));
  PlaneGrid grid{{-0.001, -0.399, -0.001}, {0.002, 0.0, 0.0}, {0.0, 0.0, 0.002}, {0.0, -1.0, 0.0}, 2, 2};
  const auto found = figures(light(), grid);
  EXPECT_NEAR(found.figures.mean, 40.0, 0.01);
  EXPECT_NEAR(found.figures.mean_error, 2.5, 0.01);
  EXPECT_NEAR(found.error[0], 2.5, 0.01);
}

}  // namespace
}  // namespace radiosity::solver
