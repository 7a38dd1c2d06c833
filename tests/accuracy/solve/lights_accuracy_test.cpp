// Lights without extent, the sky and see-through surfaces: the program as a whole against closed forms and the path
// tracer, which has its own lights, sky and coverage. Exit code 3 (time limit) is allowed: the claim is about the
// result, not about the machine's speed.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/accuracy/balance.h"
#include "tests/accuracy/compare.h"
#include "tests/accuracy/solve/solved.h"
#include "tests/accuracy/solve_run.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::Light;
using test_scenes::TestScene;

Solved solveLightsFile(const std::filesystem::path& file, const std::vector<std::string>& arguments) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const auto folder = std::filesystem::path(RADIOSITY_BINARY_DIR) / "accuracy" /
                      (std::string(test->test_suite_name()) + "." + test->name());
  const auto run = runSolve(RADIOSITY_CLIENT, file, folder, arguments);
  EXPECT_TRUE(run.exit_code == 0 || run.exit_code == 3) << "exit code " << run.exit_code;
  return {readLitScene(run.output, file), run.report};
}

Solved solveLights(const TestScene& scene, const std::vector<std::string>& arguments) {
  const auto folder = std::filesystem::path(RADIOSITY_BINARY_DIR) / "accuracy" / "lights";
  std::filesystem::create_directories(folder);
  const auto file = folder / (scene.name + ".glb");
  test_scenes::writeGlb(scene, file);
  return solveLightsFile(file, arguments);
}

Accuracy compareLights(const Solved& solved, std::size_t texels = 800) {
  const auto reference =
      makeReference(solved.lit, {.texel_samples = 4096, .point_samples = 64, .texels = texels, .points = 1});
  const auto accuracy = measure(solved.lit, reference);
  testing::Test::RecordProperty("solver_error", std::to_string(accuracy.solver.solverRms()));
  testing::Test::RecordProperty("bias", std::to_string(accuracy.solver.bias));
  return accuracy;
}

/// A black floor of side 2 about the origin that looks up; nothing else.
TestScene blackFloor(const std::string& name) {
  TestScene scene;
  scene.name = name;
  const auto black = scene.add({"black", glm::dvec3(0.0), glm::dvec3(0.0)});
  scene.objects.push_back({"floor", {}, {{{{-1, 0, -1}, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1}}, black}}});
  return scene;
}

/// Relative RMS of whole texels from a formula of their middle.
template <typename Formula>
double rmsFrom(const LitScene& lit, Formula formula) {
  std::vector<oracle::Comparison> comparisons;
  for (const auto& texel : findTexels(lit)) {
    if (texel.coverage < 0.999) continue;
    glm::dvec3 middle(0.0);
    for (const auto& piece : texel.footprint.pieces) {
      middle += (piece.corners[0] + piece.corners[1] + piece.corners[2]) / 3.0;
    }
    middle /= static_cast<double>(texel.footprint.pieces.size());
    const auto value = lit.pages.at(static_cast<std::size_t>(texel.page)).at(texel.x, texel.y);
    comparisons.push_back({value, formula(middle), {}, texel.footprint.area()});
  }
  EXPECT_FALSE(comparisons.empty());
  return oracle::measureError(comparisons).relative_rms;
}

constexpr glm::dvec3 kPoint{0.2, 1.5, 0.1}, kCandela{100.0, 50.0, 20.0};
/// Of a point there, or of anything that shines alike all around it.
glm::dvec3 underThePoint(const glm::dvec3& at) {
  const glm::dvec3 d = kPoint - at;
  return kCandela * (d.y / std::pow(glm::length(d), 3.0));
}

// The formulas hold at a texel's middle; its mean differs by the curvature over a texel of 1/30 of the height, and the
// receiving points are jittered: some 0.3 % together.
constexpr double kMiddleForMean = 0.005;

TEST(SolvedLights, PointLightOverAPlane) {
  auto scene = blackFloor("point");
  scene.lights.push_back({.position = kPoint, .intensity = kCandela});
  const auto solved = solveLights(scene, {"--error", "0.005", "--time-limit", "10", "--texels", "1600"});
  EXPECT_LT(rmsFrom(solved.lit, &underThePoint), kMiddleForMean);
  expectBalance(solved.report);
  const double candela = 0.2126 * 100.0 + 0.7152 * 50.0 + 0.0722 * 20.0;
  EXPECT_NEAR(solved.report["energy"]["emitted"].get<double>(), 4.0 * std::numbers::pi * candela, 0.01);
}

TEST(SolvedLights, ADiscOverAPlaneIsItsFormFactor) {
  auto scene = blackFloor("disc");
  scene.lights.push_back({.kind = Light::Kind::kDisc,
                          .position = {0.2, 1.5, 0.1},
                          .target = {0.2, 0.0, 0.1},
                          .intensity = {1000.0, 500.0, 200.0},
                          .radius_m = 0.6});
  const auto solved = solveLights(scene, {"--error", "0.005", "--time-limit", "20", "--texels", "1600"});
  EXPECT_LT(rmsFrom(solved.lit,
                    [](const glm::dvec3& at) {
                      const double h2 = 1.5 * 1.5, r2 = 0.6 * 0.6;
                      const double o2 = std::pow(at.x - 0.2, 2.0) + std::pow(at.z - 0.1, 2.0);
                      const double root = std::sqrt(std::pow(h2 + o2 + r2, 2.0) - 4.0 * r2 * o2);
                      return std::numbers::pi * glm::dvec3(1000, 500, 200) * 0.5 * (1.0 - (h2 + o2 - r2) / root);
                    }),
            kMiddleForMean);
  expectBalance(solved.report);
  const double nits = 0.2126 * 1000.0 + 0.7152 * 500.0 + 0.0722 * 200.0;
  EXPECT_NEAR(solved.report["energy"]["emitted"].get<double>() / (std::pow(std::numbers::pi * 0.6, 2.0) * nits), 1.0,
              1e-5);
}

TEST(SolvedLights, ARectangleOverAPlaneIsWhatItsPointsAddUpTo) {
  auto scene = blackFloor("rectangle");
  scene.lights.push_back({.kind = Light::Kind::kRectangle,
                          .position = {0.2, 1.5, 0.1},
                          .target = {0.2, 0.0, 0.1},
                          .intensity = glm::dvec3(1000.0),
                          .width_m = 1.2,  // along Z, since it shines straight down
                          .height_m = 0.4});
  const auto solved = solveLights(scene, {"--error", "0.005", "--time-limit", "20", "--texels", "1600"});
  EXPECT_LT(rmsFrom(solved.lit,
                    [](const glm::dvec3& at) {
                      double sum = 0.0;
                      for (int i = 0; i < 30; ++i)
                        for (int j = 0; j < 10; ++j) {
                          const glm::dvec3 d = glm::dvec3(0.04 * (j + 0.5), 1.5, -0.5 + 0.04 * (i + 0.5)) - at;
                          sum += 1000.0 * 0.0016 * d.y * d.y / std::pow(glm::dot(d, d), 2.0);
                        }
                      return glm::dvec3(sum);
                    }),
            kMiddleForMean);
  expectBalance(solved.report);
}

TEST(SolvedLights, AGlobeOverAPlaneIsAPointOfItsFlux) {
  auto scene = blackFloor("globe");
  scene.lights.push_back({.position = kPoint, .intensity = kCandela, .radius_m = 0.5});
  const auto solved = solveLights(scene, {"--error", "0.005", "--time-limit", "20", "--texels", "1600"});
  EXPECT_LT(rmsFrom(solved.lit, &underThePoint), kMiddleForMean);
  expectBalance(solved.report);
}

TEST(SolvedLights, SunOnAPlane) {
  auto scene = blackFloor("sun");
  scene.lights.push_back(
      {.kind = Light::Kind::kDirectional, .position = {1, 2, 1}, .target = {}, .intensity = glm::dvec3(1000.0)});
  const auto solved = solveLights(scene, {"--error", "0.005", "--time-limit", "10", "--texels", "1600"});
  const double exact = 1000.0 * 2.0 / std::sqrt(6.0);
  // The one link of every texel is the same, and kept to half a unit of its eleventh bit.
  EXPECT_LT(rmsFrom(solved.lit, [&](const glm::dvec3&) { return glm::dvec3(exact); }), 0x1p-12);
  expectBalance(solved.report);
}

TEST(SolvedLights, SkyOverAPlaneFromTheCommandLine) {
  const auto solved = solveLights(blackFloor("sky"), {"--error", "0.005", "--time-limit", "10", "--texels", "1600",
                                                      "--sky", "100,200,300/10,20,30"});
  EXPECT_LT(rmsFrom(solved.lit, [](const glm::dvec3&) { return std::numbers::pi * glm::dvec3(100, 200, 300); }), 1e-4);
  expectBalance(solved.report);
}

TEST(SolvedLights, ASceneInWhichNothingShinesSaysSoAndNamesTheSky) {
  const auto solved = solveLights(blackFloor("dark"), {"--texels", "400"});
  const auto warnings = solved.report.at("warnings").dump();
  EXPECT_NE(warnings.find("nothing shines"), std::string::npos) << warnings;
  EXPECT_NE(warnings.find("--sky"), std::string::npos) << warnings;
}

/// A room without a ceiling's worth of light: open to one side, a table in it, walls that reflect.
TestScene furnishedRoom(const std::string& name) {
  TestScene scene;
  scene.name = name;
  const auto white = scene.add({"white", glm::dvec3(0.7), glm::dvec3(0.0)});
  const auto red = scene.add({"red", {0.6, 0.2, 0.1}, glm::dvec3(0.0)});
  test_scenes::Object room{"room", {}, {}};
  test_scenes::appendBox(room, {-1.0, 0.0, -1.0}, {1.0, 1.6, 1.0}, {red, white, white, white, white, white},
                         test_scenes::kZMax, true);
  scene.objects.push_back(std::move(room));
  test_scenes::Object block{"block", {}, {}};
  test_scenes::appendBox(block, {-0.3, 0.0, -0.4}, {0.2, 0.7, 0.1}, test_scenes::allFaces(white), test_scenes::kYMin,
                         false);
  scene.objects.push_back(std::move(block));
  return scene;
}

// The mean light of single texels is what is compared.
const std::vector<std::string> kRoomArguments{"--error", "0.01", "--time-limit", "40", "--texels", "4000", "--means"};

// The stated error of these solves is 0.01; texels that a shadow's edge crosses, and corners, may double it.
constexpr double kRoomError = 0.025;

TEST(SolvedLights, ARoomWithAPointLightASpotAndTheSunMatchesThePathTracer) {
  auto scene = furnishedRoom("room_lights");
  scene.lights.push_back({.position = {0.4, 1.3, 0.3}, .intensity = {40.0, 35.0, 30.0}, .range_m = 5.0});
  scene.lights.push_back({.kind = Light::Kind::kSpot,
                          .position = {-0.7, 1.4, 0.6},
                          .target = {-0.1, 0.0, 0.2},
                          .intensity = {10.0, 60.0, 20.0},
                          .inner_cone_rad = 0.2,
                          .outer_cone_rad = 0.5});
  scene.lights.push_back(
      {.kind = Light::Kind::kDirectional, .position = {0.3, 0.6, 1.0}, .target = {}, .intensity = glm::dvec3(30.0)});
  const auto solved = solveLights(scene, kRoomArguments);
  const auto accuracy = compareLights(solved);
  EXPECT_LT(accuracy.solver.solverRms(), kRoomError);
  EXPECT_LT(std::abs(accuracy.solver.bias), 0.01);
  expectBalance(solved.report);
}

TEST(SolvedLights, ARoomWithLampsOfASizeMatchesThePathTracer) {
  auto scene = furnishedRoom("room_areas");
  scene.lights.push_back({.kind = Light::Kind::kRectangle,
                          .position = {0.3, 1.55, 0.2},
                          .target = {0.3, 0.0, 0.2},
                          .intensity = {80.0, 70.0, 60.0},
                          .width_m = 0.6,
                          .height_m = 0.3});
  scene.lights.push_back({.kind = Light::Kind::kDisc,
                          .position = {-0.8, 0.9, 0.5},
                          .target = {0.0, 0.3, 0.0},
                          .intensity = {100.0, 200.0, 150.0},
                          .radius_m = 0.1});
  scene.lights.push_back({.position = {0.6, 0.8, -0.5}, .intensity = {10.0, 9.0, 8.0}, .radius_m = 0.15});
  scene.lights.push_back({.kind = Light::Kind::kSpot,
                          .position = {0.7, 1.4, 0.7},
                          .target = {0.0, 0.5, 0.0},
                          .intensity = {30.0, 10.0, 20.0},
                          .inner_cone_rad = 0.2,
                          .outer_cone_rad = 0.5,
                          .radius_m = 0.05});
  const auto solved = solveLights(scene, kRoomArguments);
  const auto accuracy = compareLights(solved);
  EXPECT_LT(accuracy.solver.solverRms(), kRoomError);
  EXPECT_LT(std::abs(accuracy.solver.bias), 0.01);
  expectBalance(solved.report);
}

TEST(SolvedLights, ARoomOpenToTheSkyMatchesThePathTracer) {
  auto scene = furnishedRoom("room_sky");
  scene.sky_upper_nits = {80.0, 100.0, 140.0};
  scene.sky_lower_nits = {30.0, 25.0, 20.0};
  const auto solved = solveLights(scene, kRoomArguments);
  const auto accuracy = compareLights(solved);
  EXPECT_LT(accuracy.solver.solverRms(), kRoomError);
  EXPECT_LT(std::abs(accuracy.solver.bias), 0.01);
  expectBalance(solved.report);
}

TEST(SolvedLights, ARoomWithAHalfOpaqueScreenMatchesThePathTracer) {
  auto scene = furnishedRoom("room_screen");
  const auto veil = scene.add({"veil", glm::dvec3(0.5), glm::dvec3(0.0), 0.5, true});
  scene.objects.push_back(
      {"screen", {}, {{{{-0.9, 1.0, -0.9}, {-0.9, 1.0, 0.9}, {0.9, 1.0, 0.9}, {0.9, 1.0, -0.9}}, veil}}});
  scene.lights.push_back({.position = {0.3, 1.4, 0.3}, .intensity = glm::dvec3(40.0)});
  const auto solved = solveLights(scene, kRoomArguments);
  const auto accuracy = compareLights(solved);
  EXPECT_LT(accuracy.solver.solverRms(), kRoomError);
  EXPECT_LT(std::abs(accuracy.solver.bias), 0.01);
  expectBalance(solved.report);
}

std::filesystem::path sharedScene(const std::string& name) {
  return std::filesystem::path(RADIOSITY_SHARED_DIR) / "scenes" / name;
}

TEST(SolvedLights, PlaycanvasLightsMatchThePathTracer) {
  const auto file = sharedScene("features/playcanvas_Lights.glb");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not there";
  const auto solved = solveLightsFile(file, {"--error", "0.01", "--time-limit", "20", "--texels", "2000", "--means"});
  const auto accuracy = compareLights(solved);
  EXPECT_LT(accuracy.solver.solverRms(), 0.02);  // a cube: no shadows, no interreflection
  EXPECT_LT(std::abs(accuracy.solver.bias), 0.005);
  expectBalance(solved.report);
}

TEST(SolvedLights, MixedLightingMatchesThePathTracer) {
  const auto file = sharedScene("bevy_MixedLighting/MixedLightingExample.gltf");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not there";
  const auto solved = solveLightsFile(file, {"--error", "0.05", "--time-limit", "60", "--texels", "6000"});
  const auto accuracy = compareLights(solved);
  // Texels of the chair's curved charts bend by 15 degrees, and its metal varies within them.
  EXPECT_LT(accuracy.solver.solverRms(), 0.10);
  EXPECT_LT(std::abs(accuracy.solver.bias), 0.03);
}

TEST(SolvedLights, AlphaBlendModeTestUnderASkyMatchesThePathTracer) {
  const auto file = sharedScene("features/AlphaBlendModeTest/AlphaBlendModeTest.gltf");
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not there";
  const auto solved =
      solveLightsFile(file, {"--error", "0.03", "--time-limit", "60", "--texels", "6000", "--sky", "1000/300"});
  auto compared = solved;
  setSky("1000/300", compared.lit);
  // Labels lie on the sloping front of the bed, one on another, closer than single precision tells apart: what is below
  // them is not seen and not compared. They stay in the scene.
  for (auto& triangle : compared.lit.scene.triangles) {
    if (std::abs(std::abs(triangle.normal.y) - 0.83) < 0.01) triangle.lightmap_page = -1;
  }
  const auto accuracy = compareLights(compared);
  EXPECT_LT(accuracy.solver.solverRms(), 0.05);
  EXPECT_LT(std::abs(accuracy.solver.bias), 0.01);
}

}  // namespace
}  // namespace radiosity::accuracy
