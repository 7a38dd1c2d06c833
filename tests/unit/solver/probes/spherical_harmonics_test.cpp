// Spherical harmonics of polygons, against sums over many directions.
#include "server/solver/probes/spherical_harmonics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <vector>

namespace radiosity::solver {
namespace {

using std::numbers::pi;
using Harmonics = std::array<double, kHarmonics>;

/// By the middles of many small parts of a parallelogram.
Harmonics summedUp(const glm::dvec3& place, const std::vector<glm::vec3>& corners) {
  constexpr int kParts = 400;
  const glm::dvec3 origin(corners[0]), u(corners[1] - corners[0]), v(corners[3] - corners[0]);
  const auto normal = glm::cross(u, v);
  Harmonics sum{};
  for (int i = 0; i < kParts * kParts; ++i) {
    const auto way = origin + (i % kParts + 0.5) / kParts * u + (i / kParts + 0.5) / kParts * v - place;
    const double square = glm::dot(way, way);
    const double angle = std::abs(glm::dot(way, normal)) / (square * std::sqrt(square)) / (kParts * kParts);
    const auto harmonics = harmonicsOf(way / std::sqrt(square));
    for (std::size_t h = 0; h < kHarmonics; ++h) sum[h] += angle * harmonics[h];
  }
  return sum;
}

TEST(SphericalHarmonics, AreOrthonormal) {
  constexpr int kRows = 400;
  std::array<Harmonics, kHarmonics> products{};
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < 2 * kRows; ++column) {
      const double z = -1.0 + (row + 0.5) * 2.0 / kRows, angle = (column + 0.5) * pi / kRows;
      const double radius = std::sqrt(1.0 - z * z);
      const auto y = harmonicsOf(glm::dvec3(radius * std::cos(angle), radius * std::sin(angle), z));
      for (std::size_t a = 0; a < kHarmonics; ++a)
        for (std::size_t b = 0; b < kHarmonics; ++b) products[a][b] += y[a] * y[b] * 4.0 * pi / (2.0 * kRows * kRows);
    }
  }
  for (std::size_t a = 0; a < kHarmonics; ++a)
    for (std::size_t b = 0; b < kHarmonics; ++b)
      EXPECT_NEAR(products[a][b], a == b ? 1.0 : 0.0, 1e-4) << a << ", " << b << ": of steps of 1/400";
}

TEST(SphericalHarmonics, OfAPolygonAreItsSumOverDirections) {
  const std::vector<glm::vec3> corners{
      {0.3F, -0.2F, 0.5F}, {0.9F, 0.1F, 0.3F}, {0.7F, 0.8F, 0.45F}, {0.1F, 0.5F, 0.65F}};
  for (const auto& place : {glm::dvec3(0.0), glm::dvec3(0.4, 0.3, 0.2), glm::dvec3(0.5, 0.3, 3.0)}) {
    const auto exact = polygonHarmonics(place, corners), summed = summedUp(place, corners);
    for (std::size_t h = 0; h < kHarmonics; ++h) EXPECT_NEAR(exact[h], summed[h], 1e-5) << h;
    const std::vector<glm::vec3> turned(corners.rbegin(), corners.rend());
    const auto other = polygonHarmonics(place, turned);
    for (std::size_t h = 0; h < kHarmonics; ++h) EXPECT_NEAR(exact[h], other[h], 1e-12) << h << ", other winding";
  }
}

// All around there is as much of every direction: nothing but band 0 is left, sqrt(4 pi).
TEST(SphericalHarmonics, OfTheFacesOfACubeAroundAPlaceAreThoseOfAllDirections) {
  Harmonics sum{};
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-1.0F, 1.0F}) {
      std::vector<glm::vec3> corners;
      for (const auto& [u, v] : {std::pair{-1.0F, -1.0F}, {1.0F, -1.0F}, {1.0F, 1.0F}, {-1.0F, 1.0F}}) {
        glm::vec3 corner;
        corner[axis] = side;
        corner[(axis + 1) % 3] = u;
        corner[(axis + 2) % 3] = v;
        corners.push_back(corner);
      }
      const auto of_face = polygonHarmonics({0.3, -0.5, 0.2}, corners);
      for (std::size_t h = 0; h < kHarmonics; ++h) sum[h] += of_face[h];
    }
  }
  EXPECT_NEAR(sum[0], std::sqrt(4.0 * pi), 1e-12);
  for (std::size_t h = 1; h < kHarmonics; ++h) EXPECT_NEAR(sum[h], 0.0, 1e-12) << h;
}

// Where sums over edges cancel most: seen from a thousand widths away.
TEST(SphericalHarmonics, OfAFarPolygonAreThoseOfItsDirection) {
  const std::vector<glm::vec3> corners{
      {-5e-4F, -5e-4F, 1.0F}, {5e-4F, -5e-4F, 1.0F}, {5e-4F, 5e-4F, 1.0F}, {-5e-4F, 5e-4F, 1.0F}};
  const auto found = polygonHarmonics(glm::dvec3(0.0), corners);
  const auto way = harmonicsOf(glm::dvec3(0.0, 0.0, 1.0));
  for (std::size_t h = 0; h < kHarmonics; ++h) EXPECT_NEAR(found[h], 1e-6 * way[h], 1e-11) << h;
}

}  // namespace
}  // namespace radiosity::solver
