// Daylight factors against closed forms of the CIE overcast sky.
#include "server/solver/planes/sky_solve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>

#include "server/scene/values/daylight.h"
#include "server/solver/planes/plane_figures.h"
#include "server/solver/planes/plane_rays.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using std::numbers::pi;

LightSources overcast(double ground_nits = 0.0) {
  LightSources sources;
  sources.sky.picture = scene::SharedSkyPicture(std::make_shared<const scene::SkyPicture>(
      scene::daylightImage(scene::cieShape(scene::kCieOvercast), {0.0, 1.0, 0.0}, 10'000.0, ground_nits)));
  return sources;
}

class DaylightFactors : public testing::Test {
 protected:
  /// Percent, of a plane of one point.
  [[nodiscard]] static PlaneFigures factorAt(const std::vector<test::Quad>& quads, const glm::dvec3& at,
                                             const glm::dvec3& normal, double ground_nits = 0.0,
                                             std::uint64_t seed = 1) {
    const auto scene = test::makeQuadScene(quads);
    const std::vector<glm::vec3> dark(scene.patches->nodeCount(), glm::vec3(0.0F));
    const auto sources = overcast(ground_nits);
    PlaceLight light({*scene.patches, nullptr, nullptr, scene.materials, sources, dark});
    const auto solution = solveUnderSky(light, *scene.patches, seed);
    light.setIrradiance(solution.irradiance, solution.difference);
    PlaneRays rays(light, {at, {1e-4, 0.0, 0.0}, {0.0, 0.0, 1e-4}, normal, 1, 1}, seed);
    rays.measure(0.002);
    return planeFigures(rays, 0.0, {}, 100.0 / horizontalIlluminance(light)).figures;
  }
  static test::Quad floor(float reflectance = 0.0F) {
    test::Quad quad{{-0.5F, -0.4F, 0.5F}, {1.0F, 0.0F, 0.0F}, {0.0F, 0.0F, -1.0F}};
    quad.reflectance = glm::vec3(reflectance);
    return quad;
  }
};

TEST_F(DaylightFactors, OfAnUnobstructedPlaneIsAHundredPercent) {
  const auto found = factorAt({floor()}, {0.0, 0.0, 0.0}, {0.0, 1.0, 0.0});
  EXPECT_NEAR(found.mean, 100.0, 0.3);
  EXPECT_LT(found.mean_error, 0.3);
}

// L = Lz (1 + 2 sin g) / 3: the level ground gets 7 pi Lz / 9, and an upright plane, over black ground, the integral of
// L cos^2 g cos a over its quarter, Lz (pi / 6 + 4 / 9): 39.6 % (Moon and Spencer 1942).
TEST_F(DaylightFactors, OfAnUprightPlaneIsTwoFifths) {
  const auto found = factorAt({floor()}, {0.0, 0.3, 0.0}, {1.0, 0.0, 0.0});
  EXPECT_NEAR(found.mean, 100.0 * (pi / 6.0 + 4.0 / 9.0) / (7.0 * pi / 9.0), 0.3);
}

// Ground of luminance G fills the lower quarter: half of what level ground of pi G would get.
TEST_F(DaylightFactors, CountTheGroundOutside) {
  const double ground = 0.2 * 10'000.0 / pi;
  const test::Quad chip{{-0.5F, -0.4F, 0.5F}, {0.01F, 0.0F, 0.0F}, {0.0F, 0.0F, -0.01F}};
  const auto black = factorAt({chip}, {0.0, 0.3, 0.0}, {1.0, 0.0, 0.0});
  const auto grey = factorAt({chip}, {0.0, 0.3, 0.0}, {1.0, 0.0, 0.0}, ground);
  EXPECT_NEAR(grey.mean - black.mean, 10.0, 0.6);
}

/// A closed box of side 1 but for an opening, of black faces.
class Room {
 public:
  explicit Room(float reflectance = 0.0F) : reflectance_(reflectance) {}
  /// Front to the inside; corner, both edges.
  void add(const glm::vec3& corner, const glm::vec3& u, const glm::vec3& v) {
    const auto inward = glm::dot(glm::cross(u, v), -(corner + 0.5F * (u + v)));
    test::Quad quad{corner, inward > 0.0F ? u : v, inward > 0.0F ? v : u};
    quad.reflectance = glm::vec3(reflectance_);
    quads_.push_back(quad);
  }
  /// A face at `level` along `axis`, but for where both other coordinates are in [low, high].
  void addWithOpening(int axis, float level, const glm::vec2& low, const glm::vec2& high) {
    const auto piece = [&](const glm::vec2& from, const glm::vec2& to) {
      glm::vec3 corner(0.0F), u(0.0F), v(0.0F);
      corner[axis] = level;
      corner[(axis + 1) % 3] = from.x;
      corner[(axis + 2) % 3] = from.y;
      u[(axis + 1) % 3] = to.x - from.x;
      v[(axis + 2) % 3] = to.y - from.y;
      add(corner, u, v);
    };
    piece({-0.5F, -0.5F}, {low.x, 0.5F});
    piece({high.x, -0.5F}, {0.5F, 0.5F});
    piece({low.x, -0.5F}, {high.x, low.y});
    piece({low.x, high.y}, {high.x, 0.5F});
  }
  void addWhole(int axis, float level) { addWithOpening(axis, level, {0.5F, 0.5F}, {0.5F, 0.5F}); }
  [[nodiscard]] std::vector<test::Quad> quads() const {
    std::vector<test::Quad> solid;
    for (const auto& quad : quads_)
      if (glm::length(glm::cross(quad.du, quad.dv)) > 0.0F) solid.push_back(quad);
    return solid;
  }

 private:
  float reflectance_;
  std::vector<test::Quad> quads_;
};

/// Percent, by the midpoint rule over the opening.
template <typename PointAt>
double skyComponent(const glm::dvec3& at, const glm::dvec3& normal, const glm::dvec3& outward, double area,
                    const PointAt& point_at) {
  constexpr int kGrid = 400;
  double sum = 0.0;
  for (int i = 0; i < kGrid; ++i) {
    for (int k = 0; k < kGrid; ++k) {
      const auto way = point_at((i + 0.5) / kGrid, (k + 0.5) / kGrid) - at;
      const double square = glm::dot(way, way), length = std::sqrt(square), rise = way.y / length;
      if (rise <= 0.0) continue;
      sum += (1.0 + 2.0 * rise) / 3.0 * std::max(0.0, glm::dot(normal, way)) / length * glm::dot(outward, way) /
             length / square;
    }
  }
  return 100.0 * sum * area / (kGrid * kGrid) / (7.0 * pi / 9.0);
}

TEST_F(DaylightFactors, UnderARoofLightAreItsSkyComponent) {
  Room room;
  for (const int axis : {0, 2})
    for (const float level : {-0.5F, 0.5F}) room.addWhole(axis, level);
  room.addWhole(1, -0.5F);
  room.addWithOpening(1, 0.5F, {-0.2F, -0.1F}, {0.2F, 0.3F});  // z from -0.2 on, x from -0.1 on
  const glm::dvec3 at(0.1, -0.1, -0.2), up(0.0, 1.0, 0.0);
  const auto expected = skyComponent(
      at, up, up, 0.16, [](double u, double v) { return glm::dvec3(-0.1 + 0.4 * v, 0.5, -0.2 + 0.4 * u); });
  const auto found = factorAt(room.quads(), at, up);
  EXPECT_NEAR(found.mean, expected, 4.0 * found.mean_error + 0.005 * expected);
  EXPECT_LT(found.mean_error, 0.02 * expected);
}

TEST_F(DaylightFactors, BehindAWindowAreItsSkyComponent) {
  Room room;
  for (const int axis : {1, 2})
    for (const float level : {-0.5F, 0.5F}) room.addWhole(axis, level);
  room.addWhole(0, -0.5F);
  room.addWithOpening(0, 0.5F, {-0.1F, -0.3F}, {0.3F, 0.3F});  // y from -0.1 on, z from -0.3 on
  const glm::dvec3 at(0.1, -0.3, 0.1), up(0.0, 1.0, 0.0);
  const auto expected = skyComponent(at, up, {1.0, 0.0, 0.0}, 0.24, [](double u, double v) {
    return glm::dvec3(0.5, -0.1 + 0.4 * u, -0.3 + 0.6 * v);
  });
  const auto found = factorAt(room.quads(), at, up);
  EXPECT_NEAR(found.mean, expected, 4.0 * found.mean_error + 0.005 * expected);
}

// Half of what the floor gets, which is all.
TEST_F(DaylightFactors, CountReflections) {
  EXPECT_NEAR(factorAt({floor(0.5F)}, {0.0, -0.3995, 0.0}, {0.0, -1.0, 0.0}).mean, 50.0, 0.5);
}

// In a grey room with a roof light many bounces count. Over seeds the mean scatters by what is stated, or less, since
// all of what the halves of the solve differ by counts as if it were the same everywhere.
TEST_F(DaylightFactors, InAGreyRoomScatterByTheStatedError) {
  Room room(0.7F);
  for (const int axis : {0, 2})
    for (const float level : {-0.5F, 0.5F}) room.addWhole(axis, level);
  room.addWhole(1, -0.5F);
  room.addWithOpening(1, 0.5F, {-0.2F, -0.1F}, {0.2F, 0.3F});
  double sum = 0.0, squares = 0.0, stated = 0.0;
  constexpr int kSeeds = 12;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const auto found = factorAt(room.quads(), {0.1, -0.1, -0.2}, {0.0, 1.0, 0.0}, 0.0, seed);
    sum += found.mean / kSeeds;
    squares += found.mean * found.mean / kSeeds;
    stated += found.mean_error * found.mean_error / kSeeds;
  }
  const double scatter = std::sqrt((squares - sum * sum) * kSeeds / (kSeeds - 1.0));
  EXPECT_LT(scatter, 1.6 * std::sqrt(stated)) << "chi-square of 11 degrees of freedom: 1.6^2 has a chance of 0.002";
  EXPECT_GT(scatter, 0.2 * std::sqrt(stated));
  EXPECT_LT(std::sqrt(stated), 0.02 * sum);
}

}  // namespace
}  // namespace radiosity::solver
