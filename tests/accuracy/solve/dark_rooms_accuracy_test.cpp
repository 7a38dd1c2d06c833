// No light where none can be: closed huts on a ground that is their floor, too, and the dark half of a divided room,
// with walls of one sheet, of a millimetre and of a hand's width, anywhere on the grid of texels. What a viewer looks
// up within is exactly nothing, and what is lit keeps its light.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <filesystem>
#include <functional>
#include <glm/geometric.hpp>
#include <iostream>
#include <string>
#include <vector>

#include "tests/accuracy/solve_run.h"
#include "tests/accuracy/surface.h"
#include "tests/oracle/surface_finder.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::allFaces;
using test_scenes::Light;
using test_scenes::TestScene;

constexpr double kHigh = 3.0;

struct Walls {
  double thickness;
  double shift;  ///< of all, against the grid of texels
  double turn_rad;
  double most = 0.0;  ///< lux that may be looked up within a hut; in the sun there are 40,000
};
void PrintTo(const Walls& walls, std::ostream* out) {
  *out << 1000.0 * walls.thickness << " mm, shifted by " << walls.shift << ", turned by " << walls.turn_rad;
}

/// 4 x 3 x 4 m about the origin, on a ground of 20 m under the sun.
TestScene hut(const Walls& walls) {
  TestScene scene;
  scene.name = "hut";
  const auto grey = scene.add({"grey", glm::dvec3(0.7), glm::dvec3(0.0)});
  auto two_sided = test_scenes::Material{"sheet", glm::dvec3(0.7), glm::dvec3(0.0)};
  two_sided.double_sided = true;
  const auto sheet = scene.add(two_sided);
  scene.objects.push_back({"ground", {}, {{{{-10, 0, -10}, {-10, 0, 10}, {10, 0, 10}, {10, 0, -10}}, grey}}});
  test_scenes::Object house{"house", {}, {}};
  const double a = 2.0, t = walls.thickness;
  const auto slab = [&](glm::dvec3 low, glm::dvec3 high) { appendBox(house, low, high, allFaces(grey)); };
  if (t == 0.0) {
    appendBox(house, {-a, 0, -a}, {a, kHigh, a}, allFaces(sheet), test_scenes::kYMin);
  } else {
    slab({-a - t, 0, -a - t}, {-a, kHigh, a + t});
    slab({a, 0, -a - t}, {a + t, kHigh, a + t});
    slab({-a, 0, -a - t}, {a, kHigh, -a});
    slab({-a, 0, a}, {a, kHigh, a + t});
    slab({-a - t, kHigh, -a - t}, {a + t, kHigh + t, a + t});
  }
  test_scenes::turn(house, walls.turn_rad);
  test_scenes::move(house, {walls.shift, 0, 0.5 * walls.shift});
  scene.objects.push_back(std::move(house));
  scene.lights.push_back({.kind = Light::Kind::kDirectional,
                          .position = {3, 4, 2},
                          .target = glm::dvec3(0.0),
                          .intensity = glm::dvec3(50'000.0)});
  return scene;
}

/// 4 x 3 x 4 m about the origin, with a point light in the half of x below the wall.
TestScene divided(const Walls& walls) {
  TestScene scene;
  scene.name = "divided";
  const auto grey = scene.add({"grey", glm::dvec3(0.7), glm::dvec3(0.0)});
  test_scenes::Object room{"room", {}, {}}, wall{"wall", {}, {}};
  appendBox(room, {-2, 0, -2}, {2, kHigh, 2}, allFaces(grey), test_scenes::kNoFace, true);
  const double reach = 2.0 * std::tan(walls.turn_rad);
  auto two_sided = test_scenes::Material{"sheet", glm::dvec3(0.7), glm::dvec3(0.0)};
  two_sided.double_sided = true;
  const auto skin = walls.thickness == 0.0 ? scene.add(two_sided) : grey;
  const auto side = [&](double x, bool forward) {
    std::vector<glm::dvec3> corners{
        {x + reach, 0, -2}, {x - reach, 0, 2}, {x - reach, kHigh, 2}, {x + reach, kHigh, -2}};
    if (!forward) std::ranges::reverse(corners);
    wall.polygons.push_back({corners, skin});
  };
  side(walls.shift, true);
  if (walls.thickness > 0.0) side(walls.shift + walls.thickness, false);
  scene.objects.push_back(std::move(room));
  scene.objects.push_back(std::move(wall));
  scene.lights.push_back({.position = {-1.2, 2.0, 0.3}, .intensity = glm::dvec3(100.0)});
  return scene;
}

/// Brightest of what a viewer looks up at places of the floor and the ceiling.
double brightest(const LitScene& lit, const std::function<glm::dvec2(double, double)>& place) {
  const oracle::SurfaceFinder finder(lit.scene);
  double most = 0.0;
  glm::dvec3 where(0.0);
  std::size_t found = 0;
  // Dense beside the walls, where lookups mix in what is beyond.
  const std::array along{1e-3, 4e-3, 0.01, 0.03, 0.1,  0.2,  0.3,   0.42, 0.5,
                         0.61, 0.7,  0.8,  0.9,  0.97, 0.99, 0.996, 0.999};
  for (const double u : along) {
    for (const double v : along) {
      for (const double y : {0.0, kHigh}) {
        const auto at = place(u, v);
        const auto hit = finder.find({at.x, y, at.y}, {0.0, y == 0.0 ? 1.0 : -1.0, 0.0});
        if (!hit) continue;
        const auto& triangle = lit.scene.triangles[hit->triangle];
        if (triangle.lightmap_page < 0) continue;
        const auto& uv = triangle.lightmap_uv;
        const auto here = uv[0] * (1.0 - hit->u - hit->v) + uv[1] * hit->u + uv[2] * hit->v;
        const auto light = lit.pages.at(static_cast<std::size_t>(triangle.lightmap_page)).bilinear(here);
        if (const double here_most = std::max({light.x, light.y, light.z}); here_most > most) {
          most = here_most;
          where = {at.x, y, at.y};
        }
        ++found;
      }
    }
  }
  EXPECT_GT(found, along.size() * along.size());
  if (most > 0.0) std::cerr << "brightest at " << where.x << ", " << where.y << ", " << where.z << "\n";
  return most;
}

class DarkRooms : public testing::TestWithParam<Walls> {
 protected:
  static LitScene solve(const TestScene& scene, int seed) {
    std::string name = testing::UnitTest::GetInstance()->current_test_info()->name();
    std::ranges::replace(name, '/', '.');
    const auto folder = std::filesystem::path(RADIOSITY_BINARY_DIR) / "accuracy" / ("dark." + name);
    std::filesystem::create_directories(folder);
    const auto file = folder / (scene.name + ".glb");
    test_scenes::writeGlb(scene, file);
    const auto run = runSolve(RADIOSITY_CLIENT, file, folder,
                              {"--error", "0.03", "--texels", "6000", "--seed", std::to_string(seed)});
    EXPECT_EQ(run.exit_code, 0);
    return readLitScene(run.output, file);
  }
  /// The rim that is dark outside takes some of the light of what is lit.
  static void expectLight(const LitScene& lit, double within) {
    const auto points = makePoints(lit.traced(), 3000, 256, 1);
    const auto error = compareSurface(lit, points).error;
    EXPECT_GT(error.compared, 500U);
    EXPECT_NEAR(error.mean_ratio, 1.0, within);
  }
};

TEST_P(DarkRooms, aHutHasNoLightWithin) {
  const auto& walls = GetParam();
  const double c = std::cos(walls.turn_rad), s = std::sin(walls.turn_rad);
  for (const int seed : {1, 2, 3}) {
    const auto lit = solve(hut(walls), seed);
    EXPECT_LE(brightest(lit,
                        [&](double u, double v) {
                          const double x = 4.0 * u - 2.0, z = 4.0 * v - 2.0;
                          return glm::dvec2(c * x + s * z + walls.shift, c * z - s * x + 0.5 * walls.shift);
                        }),
              walls.most)
        << "seed " << seed;
    if (seed == 1) expectLight(lit, 0.03);
  }
}

TEST_P(DarkRooms, theDarkHalfOfARoomHasNoLight) {
  const auto& walls = GetParam();
  for (const int seed : {1, 2, 3}) {
    const auto lit = solve(divided(walls), seed);
    EXPECT_EQ(brightest(lit,
                        [&](double u, double v) {
                          const double z = 4.0 * v - 2.0;
                          const double first = walls.shift + walls.thickness - z * std::tan(walls.turn_rad);
                          return glm::dvec2(first + u * (2.0 - first), z);
                        }),
              0.0)
        << "seed " << seed;
    if (seed == 1) expectLight(lit, 0.05);
  }
}

// Solids of a millimetre that are turned do let in a trace of light, 0.1 % of what is outside: why is not known.
INSTANTIATE_TEST_SUITE_P(Walls, DarkRooms,
                         testing::Values(Walls{0.0, 0.0, 0.0}, Walls{0.0, 0.137, 0.3}, Walls{0.001, 0.0, 0.0},
                                         Walls{0.001, 0.137, 0.3, 200.0}, Walls{0.2, 0.0, 0.0}, Walls{0.2, 0.09, 0.2}));

}  // namespace
}  // namespace radiosity::accuracy
