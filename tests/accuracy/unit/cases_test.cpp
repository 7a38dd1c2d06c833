// The reference on small files, lent for tests, of which the right light is known: what it says of others rests on
// this.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <optional>
#include <ostream>
#include <string>

#include "tests/accuracy/surface.h"

namespace radiosity::accuracy {
namespace {

std::optional<oracle::TriangleScene> readCase(const std::string& name) {
  const auto file = std::filesystem::path(RADIOSITY_SHARED_DIR) / "cases" / (name + ".glb");
  if (!std::filesystem::exists(file)) return std::nullopt;
  return oracle::readGlb(file);
}

/// Of red, with its standard error, which falls with the root of the paths.
struct Mean {
  double lux = 0.0, error = 0.0;
};
Mean meanOver(const std::vector<SurfacePoint>& points) {
  Mean mean;
  for (const auto& point : points) {
    mean.lux += point.irradiance.mean_lux.x / static_cast<double>(points.size());
    mean.error += std::pow(point.irradiance.standard_error.x / static_cast<double>(points.size()), 2.0);
  }
  mean.error = std::sqrt(mean.error);
  return mean;
}

struct Pair {
  const char *first, *second;
  double apart = 0.0;  ///< part of the light that they may differ by
};
void PrintTo(const Pair& pair, std::ostream* out) { *out << pair.first; }
class SameLight : public testing::TestWithParam<Pair> {};

TEST_P(SameLight, IsInBothFilesOfAPair) {
  const auto one = readCase(GetParam().first), other = readCase(GetParam().second);
  if (!one || !other) GTEST_SKIP() << GetParam().first << " or its twin is not there";
  const auto a = meanOver(makePoints(*one, 300, 1024, 1)), b = meanOver(makePoints(*other, 300, 1024, 1));
  EXPECT_GT(a.lux, 0.0);
  EXPECT_NEAR(a.lux, b.lux, 4.0 * std::hypot(a.error, b.error) + GetParam().apart * b.lux + 1e-9);
  EXPECT_LT(a.error, 0.01 * a.lux);
}

// The atlas has eight pixels, and the walls' coordinates begin a tenth of a pixel before the first one's middle: there
// the filter mixes metal in, as it does in any engine, which takes a hundredth of the light.
INSTANTIATE_TEST_SUITE_P(Cases, SameLight,
                         testing::Values(Pair{"specgloss", "specgloss-reference"},
                                         Pair{"metal-atlas-dielectric-half", "metal-atlas-none", 0.015},
                                         Pair{"mask-hidden-black", "mask-hidden-white"},
                                         Pair{"spot-equal-cones", "spot-reference"}));

// A candela of 100 at a height of one metre: 100 / (1 + r^2)^(3/2) on the floor; and nothing on its other side.
TEST(Cases, APointLightOverAFloorLightsOneOfItsSidesAndNotTheOther) {
  for (const auto* name : {"sides-floor-single", "sides-floor-double"}) {
    const auto scene = readCase(name);
    if (!scene) GTEST_SKIP() << name << " is not there";
    std::size_t below = 0;
    for (const auto& point : makePoints(*scene, 100, 16, 1)) {
      const double r2 = glm::dot(point.position, point.position);
      const double exact = point.normal.y > 0.0 ? 100.0 / std::pow(1.0 + r2, 1.5) : 0.0;
      EXPECT_NEAR(point.irradiance.mean_lux.x, exact, 1e-6 * exact);
      below += point.normal.y < 0.0 ? 1 : 0;
    }
    EXPECT_EQ(below, std::string(name) == "sides-floor-double" ? 50U : 0U);
  }
}

// Plates moved one metre and half a metre up, under lights of 100 candela at two: 100 and 44.4 lux in their middle.
TEST(Cases, MorphWeightsMovePlatesTowardsTheirLights) {
  const auto scene = readCase("pose-morph-weights");
  if (!scene) GTEST_SKIP() << "pose-morph-weights is not there";
  const std::vector middles{oracle::Footprint::at({0, 1, 0}, {0, 1, 0}),
                            oracle::Footprint::at({10, 0.5, 0}, {0, 1, 0})};
  const auto lux = oracle::PathTracer(*scene).irradiance(middles, {.samples = 16});
  // each also sees the other's light, ten metres away
  EXPECT_NEAR(lux[0].mean_lux.x, 100.0 + 100.0 * 1.0 / std::pow(101.0, 1.5), 1e-3);
  EXPECT_NEAR(lux[1].mean_lux.x, 100.0 / 2.25 + 100.0 * 1.5 / std::pow(102.25, 1.5), 1e-3);
  double highest = -1.0, lowest = 9.0;
  for (const auto& triangle : scene->triangles) {
    highest = std::max(highest, triangle.corners[0].y);
    lowest = std::min(lowest, triangle.corners[0].y);
  }
  EXPECT_NEAR(highest, 1.0, 1e-6);
  EXPECT_NEAR(lowest, 0.5, 1e-6);
}

// A ball whose normals are those of a sphere: the sun's 1,000 lux by the cosine to the direction from its middle, where
// the facet itself faces the sun.
TEST(Cases, ABallOfFewFacetsIsLitAsASphere) {
  const auto scene = readCase("smooth-normals-ball");
  if (!scene) GTEST_SKIP() << "smooth-normals-ball is not there";
  const auto to_sun = -scene->lamps.at(0).direction;
  std::size_t lit = 0;
  for (const auto& point : makePoints(*scene, 200, 16, 1)) {
    const bool faces = glm::dot(point.normal, to_sun) > 0.0;
    const double cosine = glm::dot(glm::normalize(point.position), to_sun);
    // Between the corners the direction is interpolated linearly: off by a hundredth at most over facets of 16 degrees.
    EXPECT_NEAR(point.irradiance.mean_lux.x, faces ? 1000.0 * std::max(0.0, cosine) : 0.0, 10.0);
    lit += point.irradiance.mean_lux.x > 0.0 ? 1 : 0;
  }
  EXPECT_GT(lit, 80U);
}

}  // namespace
}  // namespace radiosity::accuracy
