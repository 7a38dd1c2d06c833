#include "tests/oracle/form_factors.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <glm/geometric.hpp>

namespace radiosity::oracle {
namespace {

Corners unitSquareUp() { return {{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}; }
Corners unitSquareDown(double z) { return {{0, 0, z}, {0, 1, z}, {1, 1, z}, {1, 0, z}}; }

TEST(ClosedForms, ParallelSquaresAndRectangles) {
  EXPECT_NEAR(parallelRectangles(1, 1, 1), 0.1998248957, 1e-10);
  EXPECT_NEAR(parallelRectangles(0.1, 0.1, 1), 0.0031620568, 1e-10);
  EXPECT_NEAR(parallelRectangles(2, 1, 1), 0.2858753849, 1e-10);
}

TEST(ClosedForms, PerpendicularSquaresAndRectangles) {
  EXPECT_NEAR(perpendicularRectangles(1, 1, 1), 0.2000437761, 1e-10);
  EXPECT_NEAR(perpendicularRectangles(1, 1, 2), 0.2328526028, 1e-10);
  EXPECT_NEAR(perpendicularRectangles(1, 1, 0.5), 0.1461866791, 1e-10);
}

TEST(ClosedForms, CoaxialDiscs) { EXPECT_NEAR(coaxialDiscs(1, 1, 1), 0.3819660113, 1e-10); }

TEST(PointToPolygon, CentreOfASquareSeesItsOppositeAsLambertSays) {
  EXPECT_NEAR(pointToPolygon({0.5, 0.5, 0}, {0, 0, 1}, unitSquareDown(1)), 0.239456, 5e-7);
}

TEST(PointToPolygon, HugeCeilingFillsTheHemisphere) {
  const Corners ceiling{{-1e4, -1e4, 1}, {-1e4, 1e4, 1}, {1e4, 1e4, 1}, {1e4, -1e4, 1}};
  EXPECT_NEAR(pointToPolygon({0, 0, 0}, {0, 0, 1}, ceiling), 1.0, 1e-7);
}

TEST(PointToPolygon, WallThroughTheHorizonCountsOnlyAboveIt) {
  const glm::dvec3 up{0, 0, 1};
  const Corners above{{1, -1, 0}, {1, -1, 2}, {1, 1, 2}, {1, 1, 0}};
  const Corners through{{1, -1, -3}, {1, -1, 2}, {1, 1, 2}, {1, 1, -3}};
  const double expected = pointToPolygon({0, 0, 0}, up, above);
  EXPECT_GT(expected, 0.1);
  EXPECT_NEAR(pointToPolygon({0, 0, 0}, up, through), expected, 1e-14);
}

TEST(PointToPolygon, BackFaceGivesNothing) {
  EXPECT_EQ(pointToPolygon({0.5, 0.5, 2}, {0, 0, -1}, unitSquareDown(1)), 0.0);
}

TEST(PointToPolygon, HorizontalShiftedSquareMatchesNumericIntegral) {
  const glm::dvec3 point{-0.7, 0.2, 0.1};
  const auto normal = glm::normalize(glm::dvec3{0.3, -0.2, 0.9});
  constexpr int kSide = 1000;
  double sum = 0.0;
  for (int i = 0; i < kSide; ++i) {
    for (int j = 0; j < kSide; ++j) {
      const auto d = glm::dvec3((i + 0.5) / kSide, (j + 0.5) / kSide, 1.0) - point;
      const double r2 = glm::dot(d, d);
      sum += std::max(0.0, glm::dot(d, normal)) * d.z / (r2 * r2 * M_PI);
    }
  }
  EXPECT_NEAR(pointToPolygon(point, normal, unitSquareDown(1)), sum / kSide / kSide, 1e-7);
}

TEST(PointToPolygon, OccluderHidesExactlyItsShadow) {
  const glm::dvec3 point{0.5, 0.5, 0};
  // a quarter of the view: the occluder at half the height covers one quadrant of the ceiling
  const std::array<Corners, 1> occluder{
      Corners{{0.5, 0.5, 0.5}, {0.75, 0.5, 0.5}, {0.75, 0.75, 0.5}, {0.5, 0.75, 0.5}}};
  const double all = pointToPolygon(point, {0, 0, 1}, unitSquareDown(1));
  EXPECT_NEAR(pointToPolygon(point, {0, 0, 1}, unitSquareDown(1), occluder), 0.75 * all, 1e-12);
}

TEST(PointToPolygon, OccluderBeyondThePolygonHidesNothing) {
  const std::array<Corners, 1> occluder{Corners{{0, 0, 1.5}, {1, 0, 1.5}, {1, 1, 1.5}, {0, 1, 1.5}}};
  const double all = pointToPolygon({0.5, 0.5, 0}, {0, 0, 1}, unitSquareDown(1));
  EXPECT_EQ(pointToPolygon({0.5, 0.5, 0}, {0, 0, 1}, unitSquareDown(1), occluder), all);
}

TEST(FormFactor, AdaptiveIntegralAgreesWithParallelSquares) {
  EXPECT_NEAR(formFactor(unitSquareUp(), unitSquareDown(1)), parallelRectangles(1, 1, 1), 1e-8);
  EXPECT_NEAR(formFactor(unitSquareUp(), unitSquareDown(0.1)), parallelRectangles(10, 10, 1), 1e-6);
}

TEST(FormFactor, AdaptiveIntegralAgreesWithSquaresThatShareAnEdge) {
  const Corners wall{{0, 0, 0}, {0, 1, 0}, {0, 1, 1}, {0, 0, 1}};
  EXPECT_NEAR(formFactor(unitSquareUp(), wall), perpendicularRectangles(1, 1, 1), 1e-6);
}

TEST(FormFactor, SquareToSquareWithHalfTheViewObstructed) {
  const std::array<Corners, 1> occluder{Corners{{0, 0, 0.5}, {0.5, 0, 0.5}, {0.5, 0.5, 0.5}, {0, 0.5, 0.5}}};
  EXPECT_NEAR(formFactor(unitSquareUp(), unitSquareDown(1), occluder, {1e-6, 8}), 0.149870, 2e-6);
}

TEST(FormFactor, ReciprocityHoldsForUnequalPolygons) {
  const Corners small{{0.2, 0.1, 0.7}, {0.1, 0.6, 0.7}, {0.5, 0.3, 0.7}};
  const auto large = unitSquareUp();
  EXPECT_NEAR(formFactor(small, large) * area(small), formFactor(large, small) * area(large), 1e-7);
}

TEST(FormFactor, CoplanarPolygonsDoNotSeeEachOther) {
  const Corners beside{{2, 0, 0}, {3, 0, 0}, {3, 1, 0}, {2, 1, 0}};
  EXPECT_EQ(formFactor(unitSquareUp(), beside), 0.0);
}

}  // namespace
}  // namespace radiosity::oracle
