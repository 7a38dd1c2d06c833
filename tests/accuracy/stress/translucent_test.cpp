// Light that passes translucent sheets (KHR_materials_diffuse_transmission), where its exchange has a closed form:
// B = E + rho H + tau H of the other side.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>
#include <string>
#include <utility>

#include "tests/accuracy/stress/stress_solve.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::allFaces;
using test_scenes::TestScene;
constexpr double kPi = std::numbers::pi;

test_scenes::Material sheetOf(double base, double factor, glm::dvec3 colour, double nits = 0.0) {
  test_scenes::Material sheet{"sheet", glm::dvec3(base), glm::dvec3(nits)};
  sheet.diffuse_transmission = factor;
  sheet.transmitted = colour;
  return sheet;
}

/// Two unit cubes side by side, facing inwards, with a sheet between them at x = 1 whose front faces the first.
TestScene twoCubes(const test_scenes::Material& sheet, const test_scenes::Material& of_first,
                   const test_scenes::Material& of_second) {
  TestScene scene;
  scene.name = "two_cubes";
  const auto first = scene.add(of_first), second = scene.add(of_second), between = scene.add(sheet);
  test_scenes::Object one{"first", {}, {}}, two{"second", {}, {}}, wall{"sheet", {}, {}};
  appendBox(one, {0, 0, 0}, {1, 1, 1}, allFaces(first), test_scenes::kXMax, true);
  appendBox(two, {1, 0, 0}, {2, 1, 1}, allFaces(second), test_scenes::kXMin, true);
  wall.polygons.push_back({{{1, 0, 0}, {1, 0, 1}, {1, 1, 1}, {1, 1, 0}}, between});
  scene.objects = {one, two, wall};
  return scene;
}

/// Of one side of the surfaces of a material, by area.
glm::dvec3 meanOf(const Solve& solve, const Loaded& loaded, std::uint32_t material, bool front) {
  const auto light = solve.solver().irradiance();
  glm::dvec3 sum(0.0);
  double area = 0.0;
  for (const auto& surface : loaded.patches->surfaces) {
    const auto first = surface.first_node[front != surface.flipped ? 0 : 1];
    if (surface.material != material || first == scene::kNone) continue;
    for (auto node = first; node < first + surface.width * surface.height; ++node) {
      sum += static_cast<double>(loaded.patches->node_area[node]) * glm::dvec3(light[node]);
      area += static_cast<double>(loaded.patches->node_area[node]);
    }
  }
  EXPECT_GT(area, 0.0) << "no such side has patches";
  return sum / area;
}

constexpr std::uint32_t kFirst = 0, kSecond = 1, kSheet = 2;

solver::SolverSettings settingsOf(Method method, double target) {
  solver::SolverSettings settings;
  settings.method = method;
  settings.target_error = target;
  return settings;
}

class Translucent : public testing::TestWithParam<Method> {};

// Black walls of the first cube shine: whatever the sheet sends back they keep. So its front has pi lux, its back sends
// tau of them, and of that the far wall gets what two unit squares at distance 1 exchange.
TEST_P(Translucent, ASheetBetweenALitAndADarkCubeSendsItsTransmittanceOn) {
  const glm::dvec3 tau = 0.6 * glm::dvec3(0.9, 0.5, 0.25);
  const auto loaded = load(twoCubes(sheetOf(0.8, 0.6, {0.9, 0.5, 0.25}), {"lit", glm::dvec3(0.0), glm::dvec3(1.0)},
                                    {"dark", glm::dvec3(0.0), glm::dvec3(0.0)}),
                           3000);
  Solve solve(loaded, settingsOf(GetParam(), GetParam() == Method::kPaper    ? 0.005
                                             : GetParam() == Method::kGather ? 0.01
                                                                             : 0.02));
  ASSERT_TRUE(solve.run());
  expectSound(solve);
  const auto front = meanOf(solve, loaded, kSheet, true), back = meanOf(solve, loaded, kSheet, false);
  const auto second = meanOf(solve, loaded, kSecond, true);
  const double off = GetParam() == Method::kGather ? 0.01 : 0.03;  // hemicubes at corners, as of all walls
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(front[c], kPi, off * kPi);
    EXPECT_NEAR(back[c], 0.0, 1e-6);
    // All that the sheet sends arrives on the other five faces.
    EXPECT_NEAR(5.0 * second[c], tau[c] * kPi, off * tau[c] * kPi) << c;
  }
  const auto energy = solve.solver().energy();
  const double kept = (energy.absorbed[0] + energy.unshot[0]) / energy.emitted[0];
  EXPECT_NEAR(kept, 1.0, 0.01) << "a closed scene keeps its light";
}

// As files have it that hold each side by itself, ours among them.
TEST(TranslucentSheet, ThatIsThereTwiceTurnedOverIsOneSheet) {
  for (const bool turned_first : {false, true}) {
    auto scene = twoCubes(sheetOf(0.8, 0.6, glm::dvec3(0.9)), {"lit", glm::dvec3(0.0), glm::dvec3(1.0)},
                          {"dark", glm::dvec3(0.0), glm::dvec3(0.0)});
    auto turned = scene.objects.back();
    std::ranges::reverse(turned.polygons.front().corners);
    scene.objects.insert(scene.objects.end() - (turned_first ? 1 : 0), turned);
    const auto loaded = load(scene, 3000);
    Solve solve(loaded, settingsOf(Method::kGather, 0.01));
    ASSERT_TRUE(solve.run());
    expectSound(solve);
    EXPECT_NEAR(5.0 * meanOf(solve, loaded, kSecond, true).x, 0.54 * kPi, 0.01 * 0.54 * kPi) << turned_first;
    const auto energy = solve.solver().energy();
    EXPECT_NEAR(energy.backface[0] / energy.emitted[0], 0.0, 1e-3) << turned_first;
    EXPECT_NEAR(energy.imbalance[0] / energy.emitted[0], 0.0, 0.01) << turned_first;
  }
}

// The same light on both sides, and as much of it sent on as walls reflect: nobody can tell that there is a sheet.
TEST_P(Translucent, AFurnaceDividedByASheetIsStillAFurnace) {
  const double rho = 0.7, factor = 0.5;  // reflects 0.35 of the light, lets 0.35 through
  const test_scenes::Material wall{"wall", glm::dvec3(rho), glm::dvec3(1.0)};
  const auto loaded = load(twoCubes(sheetOf(rho, factor, glm::dvec3(rho), 1.0), wall, wall), 3000);
  Solve solve(loaded, settingsOf(GetParam(), GetParam() == Method::kShooting ? 0.05 : 0.005));
  ASSERT_TRUE(solve.run());
  expectSound(solve);
  const auto off = compareToConstant(solve, kPi / (1.0 - rho));
  EXPECT_LT(std::abs(off.mean), GetParam() == Method::kGather ? 1e-5 : 0.03);
  EXPECT_LT(off.rms, GetParam() == Method::kGather ? 0.005 : 0.15) << "the other two have the noise of their images";
}

INSTANTIATE_TEST_SUITE_P(Methods, Translucent, testing::Values(Method::kGather, Method::kShooting, Method::kPaper),
                         [](const auto& info) { return std::to_string(static_cast<int>(info.param)); });

// A translucent ball that shines, 1 m, in a sphere of 2 m: within it is a furnace that loses what it lets out, and gets
// what comes back.
TEST(TranslucentBall, ExchangesLightWithTheSphereAroundItAsTheClosedFormSays) {
  const double rho1 = 0.3, tau = 0.4, rho2 = 0.6, e1 = kPi;
  TestScene scene = test_scenes::concentricSpheres({1.0, 0.0, 1.0}, {2.0, rho2, 0.0}, 3);
  scene.materials[0] = sheetOf(rho1 + tau, tau / (rho1 + tau), glm::dvec3(rho1 + tau), 1.0);
  const auto loaded = load(scene, 12000);
  Solve solve(loaded, settingsOf(Method::kGather, 0.01));
  ASSERT_TRUE(solve.run());
  expectSound(solve);
  // H within: its own radiosity; H outside: the sphere's. With f = A1 / A2:
  //   in = e1 + rho1 in + tau b2, out = e1 + rho1 b2 + tau in, b2 = rho2 (f out + (1 - f) b2).
  const double f = 0.25, back = rho2 * f / (1.0 - rho2 * (1.0 - f));  // b2 = back x out
  const double share = 1.0 - rho1 * back - tau * tau * back / (1.0 - rho1);
  const double out = (e1 + tau * e1 / (1.0 - rho1)) / share, b2 = back * out, in = (e1 + tau * b2) / (1.0 - rho1);
  // Facets see a little of what is beside them, and the level of reflected light is exact.
  EXPECT_NEAR(meanOf(solve, loaded, 0, false).x / in, 1.0, 0.01);
  EXPECT_NEAR(meanOf(solve, loaded, 0, true).x / b2, 1.0, 0.015);
  EXPECT_NEAR(meanOf(solve, loaded, 1, true).x / (f * out + (1.0 - f) * b2), 1.0, 0.01);
}

// An edit of what passes measures nothing anew, and ends where a fresh solve does.
TEST(TranslucentEdit, OfTheFactorKeepsAllRaysAndEqualsAFreshSolve) {
  const auto scene = [](double factor) {
    return twoCubes(sheetOf(0.8, factor, {0.9, 0.8, 0.7}), {"lit", glm::dvec3(0.5), glm::dvec3(1.0)},
                    {"dark", glm::dvec3(0.5), glm::dvec3(0.0)});
  };
  const auto before = load(scene(0.2), 2000), after = load(scene(0.6), 2000);
  Solve edited(before, settingsOf(Method::kGather, 0.01)), fresh(after, settingsOf(Method::kGather, 0.01));
  ASSERT_TRUE(edited.run());
  const auto samples = edited.solver().linkCounters().samples;
  ASSERT_TRUE(edited.edit(after.materials));
  ASSERT_TRUE(fresh.run());
  expectSound(edited);
  EXPECT_EQ(edited.solver().linkCounters().samples, samples) << "lamps see what they saw";
  using Part = std::pair<std::uint32_t, bool>;
  for (const auto& [object, front] :
       {Part(kFirst, true), Part(kSecond, true), Part(kSheet, true), Part(kSheet, false)}) {
    const auto a = meanOf(edited, after, object, front), b = meanOf(fresh, after, object, front);
    EXPECT_NEAR(a.x / b.x, 1.0, 0.01) << object << front;
  }
}

}  // namespace
}  // namespace radiosity::accuracy
