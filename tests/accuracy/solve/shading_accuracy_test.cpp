// Surfaces of few facets that files give smooth normals, as a user solves them, against closed forms. Exit code 3 (time
// limit) is allowed: the claim is about the result, not about the machine's speed.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <functional>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <numbers>

#include "tests/accuracy/compare.h"
#include "tests/accuracy/solve_run.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

namespace fs = std::filesystem;
using test_scenes::TestScene;

LitScene solveShadingFile(const fs::path& file, const std::vector<std::string>& arguments) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const auto folder = fs::path(RADIOSITY_BINARY_DIR) / "accuracy" / (std::string("shading.") + test->name());
  const auto run = runSolve(RADIOSITY_CLIENT, file, folder, arguments);
  EXPECT_TRUE(run.exit_code == 0 || run.exit_code == 3) << "exit code " << run.exit_code;
  return readLitScene(run.output);
}

LitScene solveShading(const TestScene& scene, const std::vector<std::string>& arguments) {
  const auto folder = fs::path(RADIOSITY_BINARY_DIR) / "accuracy" / "shading";
  fs::create_directories(folder);
  test_scenes::writeGlb(scene, folder / (scene.name + ".glb"));
  return solveShadingFile(folder / (scene.name + ".glb"), arguments);
}

/// Irradiance at a place of a facet.
using Formula = std::function<double(const glm::dvec3& at, const glm::dvec3& facet)>;

struct Compared {
  double relative_rms = 0.0, mean_ratio = 0.0;
};
/// Of the texels of a node, against the mean of the formula over what lies under each.
Compared compareShading(const LitScene& lit, const std::function<bool(const glm::dvec3&)>& is_of,
                        const Formula& formula) {
  double square = 0.0, exact_square = 0.0, found = 0.0, expected = 0.0;
  for (const auto& texel : findTexels(lit)) {
    double exact = 0.0, area = 0.0;
    for (const auto& piece : texel.footprint.pieces) {
      const auto& [a, b, c] = piece.corners;
      const double size = glm::length(glm::cross(b - a, c - a));
      if (size <= 0.0 || !is_of((a + b + c) / 3.0)) continue;
      // The middles of the four triangles that halves of its edges make.
      for (const auto& weight : {glm::dvec3(4, 1, 1), glm::dvec3(1, 4, 1), glm::dvec3(1, 1, 4), glm::dvec3(2, 2, 2)})
        exact += 0.25 * size * formula((weight.x * a + weight.y * b + weight.z * c) / 6.0, piece.normal);
      area += size;
    }
    if (area <= 0.0) continue;
    const double value = lit.pages.at(static_cast<std::size_t>(texel.page)).at(texel.x, texel.y).x;
    square += area * std::pow(value - exact / area, 2.0);
    exact_square += area * std::pow(exact / area, 2.0);
    found += area * value;
    expected += exact;
  }
  EXPECT_GT(expected, 0.0);
  return {std::sqrt(square / exact_square), found / expected};
}

bool anywhere(const glm::dvec3&) { return true; }

/// Of a ball about a centre whose corners lie on a sphere and have its normals: interpolated, they point away from it.
Formula sunOnBall(const glm::dvec3& centre, const glm::dvec3& towards, double lux) {
  return [=](const glm::dvec3& at, const glm::dvec3& facet) {
    return glm::dot(facet, towards) > 0.0 ? lux * std::max(0.0, glm::dot(glm::normalize(at - centre), towards)) : 0.0;
  };
}

// What is left is at the edge between the lit facets and the others, of which one texel sees both.
constexpr double kOfTheSun = 0.02;

TEST(SmoothNormals, ABallOfFewFacetsInTheSunIsLitAsARoundOne) {
  TestScene scene;
  scene.name = "ball_in_the_sun";
  const auto grey = scene.add({"grey", glm::dvec3(0.5), glm::dvec3(0.0)});
  test_scenes::Object ball{"ball", {1, 2, 3}, {}};
  test_scenes::appendSphere(ball, ball.origin, 0.7, 2, grey, false, true);
  scene.objects.push_back(std::move(ball));
  scene.lights.push_back({.kind = test_scenes::Light::Kind::kDirectional,
                          .position = {1, 2, 1},
                          .target = {},
                          .intensity = glm::dvec3(1000.0)});
  const auto lit = solveShading(scene, {"--error", "0.01", "--time-limit", "10", "--texels", "12000"});
  const auto compared =
      compareShading(lit, anywhere, sunOnBall({1, 2, 3}, glm::normalize(glm::dvec3(1, 2, 1)), 1000.0));
  EXPECT_LT(compared.relative_rms, kOfTheSun);
  EXPECT_NEAR(compared.mean_ratio, 1.0, 0.002);
}

TEST(SmoothNormals, TheSharedCaseHasItsRightValue) {
  const auto file = fs::path(RADIOSITY_SHARED_DIR) / "cases" / "smooth-normals-ball.glb";
  if (!fs::exists(file)) GTEST_SKIP() << "no shared cases here";
  const auto lit = solveShadingFile(file, {"--error", "0.01", "--time-limit", "10"});
  const glm::dquat sun(0.7889051662368267, -0.14595403888902017, 0.586969624326502, 0.10859427855477606);
  const auto compared = compareShading(lit, anywhere, sunOnBall(glm::dvec3(0.0), sun * glm::dvec3(0, 0, 1), 1000.0));
  EXPECT_LT(compared.relative_rms, kOfTheSun);
  EXPECT_NEAR(compared.mean_ratio, 1.0, 0.002);
}

/// All shines and reflects alike: the same light comes from everywhere, and of it what lies above both horizons counts.
TEST(SmoothNormals, ABallInAFurnaceGetsWhatIsAboveBothHorizons) {
  auto scene = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0), 2.0);
  scene.name = "ball_in_a_furnace";
  const glm::dvec3 centre(0.1, -0.2, 0.3);
  glm::dvec3 low(INFINITY), high(-INFINITY);
  for (const auto& polygon : scene.objects[0].polygons) {
    for (const auto& corner : polygon.corners) {
      low = glm::min(low, corner);
      high = glm::max(high, corner);
    }
  }
  const auto at = 0.5 * (low + high) + centre;
  test_scenes::Object ball{"ball", at, {}};
  test_scenes::appendSphere(ball, at, 0.4, 1, scene.objects[0].polygons[0].material, false, true);
  scene.objects.push_back(std::move(ball));
  const auto lit = solveShading(scene, {"--error", "0.01", "--time-limit", "20", "--texels", "8000"});
  const double whole = std::numbers::pi / (1.0 - 0.5);
  const auto isOfBall = [&](const glm::dvec3& p) { return glm::distance(p, at) < 0.5; };
  const auto compared = compareShading(lit, isOfBall, [&](const glm::dvec3& p, const glm::dvec3& facet) {
    return 0.5 * whole * (1.0 + glm::dot(glm::normalize(p - at), facet));
  });
  EXPECT_LT(compared.relative_rms, 0.015);  // the error that was asked for, and what ratios of few rays add
  EXPECT_NEAR(compared.mean_ratio, 1.0, 0.003);
}

}  // namespace
}  // namespace radiosity::accuracy
