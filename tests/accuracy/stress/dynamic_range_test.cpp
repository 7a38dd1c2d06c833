// Light of very different strength side by side, and lamps that are next to nothing in size.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "server/solver/pipeline/linked_solver.h"
#include "tests/accuracy/stress/stress_solve.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::Object;
using test_scenes::TestScene;

TEST(DynamicRange, AChannelOfAMillionthBesideOneOfAMillionIsAsExact) {
  auto scene = litRoom();
  for (auto& material : scene.materials) {
    material.reflectance = glm::dvec3(material.reflectance.x);
    if (material.emission_nits.x > 0.0) material.emission_nits = {1e6, 1e-6, 0.0};
  }
  Solve solve(load(scene, 1500));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  solve.eachLeaf([](std::uint32_t, double, const glm::dvec3& h) {
    ASSERT_NEAR(h.y * 1e12, h.x, 1e-5 * h.x);  // the same links carry both; floats add some thousand terms
    ASSERT_EQ(h.z, 0.0);
  });
}

/// Two closed rooms, furnaces of reflectance 0.5: a small one of 1e-6 nits beside one of 1e6. No wall of either lies in
/// the plane of one of the other's: there pixels on an edge let a hundred-thousandth of the light through.
TEST(DynamicRange, ARoomOfAMillionthBesideOneOfAMillionStaysWithinTheStatedErrorAndGetsNoneOfItsLight) {
  auto scene = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1e6));
  const auto dim = scene.add({"dim", glm::dvec3(0.5), glm::dvec3(1e-6)});
  Object other{"other", {}, {}};
  appendBox(other, {2.0, 0.3, 0.3}, {2.4, 0.7, 0.7}, test_scenes::allFaces(dim), test_scenes::kNoFace, true);
  scene.objects.push_back(other);
  const auto loaded = load(scene, 1200);
  Solve solve(loaded);
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  double bright = 0.0, dark = 0.0;
  solve.eachLeaf([&](std::uint32_t node, double area, const glm::dvec3& h) {
    (loaded.materials.emission[node].x > 1.0F ? bright : dark) += area * h.x;
  });
  // Irradiance is twice the emission; six faces each.
  const double unit = loaded.patches->scale * loaded.patches->scale;
  const double of_bright = 1e6 * 12.0 * std::numbers::pi / unit, of_dim = 0.16 * 1e-12 * of_bright;
  EXPECT_NEAR(bright / of_bright, 1.0, solve.solver().error().residual) << "light that is missing is stated";
  EXPECT_GE(dark, 0.49 * of_dim) << "all its direct light";
  EXPECT_LE(dark, 1.01 * of_dim) << "and no more than is its own";
}

/// A lamp of a ten-thousandth of the room, high over a black floor: there the inverse square law holds.
TEST(TinyLamps, OfATenThousandthOfTheRoomLightItByTheInverseSquareLaw) {
  constexpr double kSide = 2e-4, kHeight = 1.0, kNits = 1e9;
  TestScene scene;
  scene.name = "tiny_lamp";
  const auto black = scene.add({"black", glm::dvec3(0.0), glm::dvec3(0.0)});
  const auto light = scene.add({"light", glm::dvec3(0.0), glm::dvec3(kNits)});
  scene.objects.push_back({"floor", {}, {{{{-1, 0, -1}, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1}}, black}}});
  const double r = kSide / 2.0;
  scene.objects.push_back(
      {"lamp", {}, {{{{-r, kHeight, -r}, {r, kHeight, -r}, {r, kHeight, r}, {-r, kHeight, r}}, light}}});
  const auto loaded = load(scene, 1600);
  solver::SolverSettings settings;
  settings.target_error = 0.005;
  Solve solve(loaded, settings);
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  const auto arrives = solve.solver().irradiance();
  double square = 0.0, off = 0.0;
  for (const auto& surface : loaded.patches->surfaces) {
    if (surface.material != black) continue;
    for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
      const auto& point = loaded.patches->leaves[surface.first_leaf + leaf];
      const auto& frame = loaded.patches->triangles[point.triangle];
      const glm::dvec3 unit = glm::dvec3(frame.origin) + double(leaf % surface.width + 0.5) * glm::dvec3(frame.du) +
                              double(leaf / surface.width + 0.5) * glm::dvec3(frame.dv);
      const glm::dvec3 at = unit * loaded.patches->scale + loaded.patches->centre;
      const double d2 = at.x * at.x + at.z * at.z + kHeight * kHeight;
      const double exact = kNits * kSide * kSide * kHeight * kHeight / (d2 * d2);
      const double found = static_cast<double>(arrives[surface.first_node[0] + leaf].x);
      square += exact * exact;
      off += (found - exact) * (found - exact);
    }
  }
  ASSERT_GT(square, 0.0);
  // The stated error, and the curvature over a texel of 1/20 of the height: some 0.3 %.
  EXPECT_LT(std::sqrt(off / square), 1.5 * settings.target_error + 0.003);
}

TEST(TinyLamps, BesideALargeOneAddTheirLight) {
  auto scene = litRoom();
  for (auto& material : scene.materials) {
    if (material.emission_nits.x > 0.0) material.emission_nits = {10.0, 0.0, 0.0};
  }
  const auto tiny = scene.add({"tiny", glm::dvec3(0.5), {0.0, 1e7, 0.0}});
  test_scenes::Object lamp{"tiny", {}, {}};
  appendBox(lamp, {1.6, 0.7, 0.4}, {1.6002, 0.7002, 0.4002}, test_scenes::allFaces(tiny));
  scene.objects.push_back(lamp);
  Solve solve(load(scene, 3000));
  EXPECT_TRUE(solve.run());
  expectSound(solve);
  const auto e = solve.solver().energy();
  for (const std::size_t c : {0U, 1U}) {
    EXPECT_GT(e.emitted[c], 0.0);
    EXPECT_NEAR(e.absorbed[c] / e.emitted[c], 1.0, 0.03) << c;
  }
}

}  // namespace
}  // namespace radiosity::accuracy
