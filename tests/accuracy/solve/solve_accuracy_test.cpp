// The program as a whole against the independent references. Exit code 3 (time limit) is allowed: the claim is about
// the result, not about the machine's speed.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/accuracy/compare.h"
#include "tests/accuracy/solve_run.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

LitScene solveScene(const test_scenes::TestScene& scene, const std::vector<std::string>& arguments,
                    nlohmann::json* report = nullptr) {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const auto folder = std::filesystem::path(RADIOSITY_BINARY_DIR) / "accuracy" /
                      (std::string(test->test_suite_name()) + "." + test->name());
  std::filesystem::create_directories(folder);
  const auto file = folder / (scene.name + ".glb");
  test_scenes::writeGlb(scene, file);
  const auto run = runSolve(RADIOSITY_CLIENT, file, folder, arguments);
  EXPECT_TRUE(run.exit_code == 0 || run.exit_code == 3) << "exit code " << run.exit_code;
  if (report != nullptr) *report = run.report;
  return readLitScene(run.output, file);
}

/// The largest relative distance of any whole texel from the one value they all should have, any channel.
double worstFromConstant(const LitScene& lit, double exact) {
  double worst = 0.0;
  for (const auto& texel : findTexels(lit)) {
    if (texel.coverage < 0.999) continue;
    const auto value = lit.pages.at(static_cast<std::size_t>(texel.page)).at(texel.x, texel.y);
    for (int c = 0; c < 3; ++c) worst = std::max(worst, std::abs(value[c] / exact - 1.0));
  }
  return worst;
}

double rmsFromConstant(const LitScene& lit, double exact) {
  std::vector<oracle::Comparison> comparisons;
  for (const auto& texel : findTexels(lit)) {
    const auto value = lit.pages.at(static_cast<std::size_t>(texel.page)).at(texel.x, texel.y);
    if (texel.coverage > 0.25) comparisons.push_back({value, glm::dvec3(exact), {}, texel.footprint.area()});
  }
  EXPECT_FALSE(comparisons.empty());
  return oracle::measureError(comparisons).relative_rms;
}

TEST(SolvedScene, FurnaceOfReflectanceHalfIsWithinHalfAPercent) {
  const auto lit = solveScene(test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0)),
                              {"--error", "0.002", "--time-limit", "20", "--texels", "1500"});
  EXPECT_LT(rmsFromConstant(lit, 2.0 * std::numbers::pi), 0.005);
  EXPECT_LT(worstFromConstant(lit, 2.0 * std::numbers::pi), 0.05);
}

TEST(SolvedScene, FurnaceOfReflectanceNineTenthsIsWithinOnePercent) {
  const auto lit = solveScene(test_scenes::furnace(glm::dvec3(0.9), glm::dvec3(1.0)),
                              {"--error", "0.004", "--time-limit", "20", "--texels", "1500"});
  EXPECT_LT(rmsFromConstant(lit, 10.0 * std::numbers::pi), 0.01);
}

// Next to nothing is unknown there: samples see what they should, form factors are exact, and the equation is solved.
// What is left, a few thousandths of a percent, is to be stated all the same, within 1.5 times. Of one seed and another
// the real error differs by twice as much as what is stated, so that three are taken together. (At 0.999 less is left
// than a reflectance in single precision is off by.)
TEST(SolvedScene, AFurnaceStatesWhatItErrsBy) {
  for (const double reflectance : {0.5, 0.9}) {
    SCOPED_TRACE(reflectance);
    double stated = 0.0, real = 0.0;
    for (const auto* seed : {"1", "2", "3"}) {
      nlohmann::json report;
      const auto lit =
          solveScene(test_scenes::furnace(glm::dvec3(reflectance), glm::dvec3(1.0)), {"--seed", seed}, &report);
      const double exact = std::numbers::pi / (1.0 - reflectance);
      stated += std::pow(report["error"]["texels"].get<double>(), 2.0);
      real += std::pow(rmsFromConstant(lit, exact), 2.0);
    }
    EXPECT_LT(stated, 2.25 * real);
    EXPECT_GT(2.25 * stated, real);
  }
}

TEST(SolvedScene, CornellBoxIsWithinFivePercentOfThePathTracer) {
  nlohmann::json report;
  const auto lit = solveScene(test_scenes::cornell(), {"--error", "0.02", "--time-limit", "30"}, &report);
  const auto reference =
      makeReference(lit, {.texel_samples = 4096, .point_samples = 4096, .texels = 800, .points = 500});
  const auto accuracy = measure(lit, reference);
  RecordProperty("solver_error", std::to_string(accuracy.solver.solverRms()));
  RecordProperty("total_error", std::to_string(accuracy.total.solverRms()));
  RecordProperty("surface_median", std::to_string(accuracy.surface.median));
  EXPECT_NEAR(accuracy.surface.mean_ratio, 1.0, 0.01);
  EXPECT_LT(accuracy.surface.median, 0.025);  // of which the reference's own noise is 1.2 % by itself
  EXPECT_EQ(accuracy.surface.leaks, 0U);
  EXPECT_EQ(accuracy.surface.missed_lit, 0U);
  EXPECT_LT(accuracy.solver.solverRms(), 0.05);
  EXPECT_LT(accuracy.total.solverRms(), 0.05);
  EXPECT_LT(std::abs(accuracy.solver.bias), 0.01);
  ASSERT_TRUE(report.contains("error"));
  // the stated error is a promise: the truth is not much worse
  EXPECT_LT(accuracy.solver.solverRms(), 2.0 * report["error"]["texels"].get<double>() + 0.005);
}

/// A room with a flat lamp right under its ceiling, all of which shines, its rim of one centimetre too: on the ceiling
/// that light ends within a tenth of a texel, and the rim sees nothing else.
test_scenes::TestScene roomWithARim() {
  test_scenes::TestScene scene;
  scene.name = "rim";
  const auto white = scene.add({"white", glm::dvec3(0.8), {}});
  const auto shining = scene.add({"shining", glm::dvec3(0.5), glm::dvec3(1.0)});
  test_scenes::Object room{"room", {}, {}}, lamp{"lamp", {}, {}};
  test_scenes::appendBox(room, {-2, 0, -2}, {2, 3, 2}, test_scenes::allFaces(white), test_scenes::kNoFace, true);
  test_scenes::appendBox(lamp, {-0.375, 2.99, -0.375}, {0.375, 3, 0.375}, test_scenes::allFaces(shining),
                         test_scenes::kYMax);
  scene.objects = {room, lamp};
  return scene;
}

TEST(SolvedScene, LightThatVariesWithinTexelsIsCorrectedAndStated) {
  nlohmann::json report;
  const auto lit = solveScene(roomWithARim(), {"--error", "0.02", "--time-limit", "60", "--texels", "12000"}, &report);
  EXPECT_LE(report["error"]["texels"].get<double>(), 0.02);
  std::vector<Texel> rim;
  std::vector<oracle::Footprint> footprints;
  for (const auto& texel : findTexels(lit)) {
    const auto& piece = texel.footprint.pieces.front();
    if (std::abs(piece.normal.y) > 0.1 || piece.corners[0].y < 2.98 || std::abs(piece.corners[0].x) > 1.0) continue;
    rim.push_back(texel);
    footprints.push_back(texel.footprint);
  }
  ASSERT_GT(rim.size(), 20U);
  const auto truth = oracle::PathTracer(lit.traced()).irradiance(footprints, {.samples = 4096});
  double found = 0.0, expected = 0.0;
  for (std::size_t i = 0; i < rim.size(); ++i) {
    found += lit.pages.at(static_cast<std::size_t>(rim[i].page)).at(rim[i].x, rim[i].y).y;
    expected += truth[i].mean_lux.y;
  }
  // Single texels of the rim are a quarter and more off where all of the scene is 2 % off; all together they are not.
  // Without the correction they have less than half of their light.
  EXPECT_NEAR(found / expected, 1.0, 0.15);
  const auto reference = makeReference(lit, {.texel_samples = 4096, .point_samples = 16, .texels = 1500, .points = 10});
  const auto accuracy = measure(lit, reference);
  RecordProperty("solver_error", std::to_string(accuracy.solver.solverRms()));
  // As above. The path tracer's own error is larger than it says right beside the rim, where few paths bring most.
  EXPECT_LT(accuracy.solver.solverRms(), 2.0 * report["error"]["texels"].get<double>() + 0.005);
}

/// A white room with a lamp, a grey one, and a wall between them with a small hole.
test_scenes::TestScene roomsWithAHole() {
  constexpr double kHole = 0.02, kLow = 0.5 * (1.0 - kHole), kHigh = 0.5 * (1.0 + kHole);
  test_scenes::TestScene scene;
  scene.name = "hole";
  const auto white = scene.add({"white", glm::dvec3(0.99), {}});
  const auto grey = scene.add({"grey", glm::dvec3(0.9), {}});
  const auto shining = scene.add({"shining", glm::dvec3(0.99), glm::dvec3(100.0)});
  test_scenes::Object rooms{"rooms", {}, {}}, wall{"wall", {}, {}}, lamp{"lamp", {}, {}};
  const auto faces = test_scenes::allFaces(white);
  auto both = faces;
  both[1] = grey;  // towards the other room
  test_scenes::appendBox(rooms, {0, 0, 0}, {1, 1, 1}, faces, test_scenes::kXMax, true);
  test_scenes::appendBox(rooms, {1, 0, 0}, {2, 1, 1}, test_scenes::allFaces(grey), test_scenes::kXMin, true);
  constexpr unsigned kFlat = test_scenes::kYMin | test_scenes::kYMax | test_scenes::kZMin | test_scenes::kZMax;
  test_scenes::appendBox(wall, {1, 0, 0}, {1, kLow, 1}, both, kFlat);
  test_scenes::appendBox(wall, {1, kHigh, 0}, {1, 1, 1}, both, kFlat);
  test_scenes::appendBox(wall, {1, kLow, 0}, {1, kHigh, kLow}, both, kFlat);
  test_scenes::appendBox(wall, {1, kLow, kHigh}, {1, kHigh, 1}, both, kFlat);
  test_scenes::appendBox(lamp, {0.4, 0.99, 0.4}, {0.6, 0.99, 0.6}, test_scenes::allFaces(shining),
                         ~static_cast<unsigned>(test_scenes::kYMin));
  scene.objects = {rooms, wall, lamp};
  return scene;
}

// Rays that hardly ever find the hole make halves differ after many bounces, which more looks of the lamp do not lower.
TEST(SolvedScene, WhiteRoomsWithAHoleBetweenThemReachTheirError) {
  nlohmann::json report;
  const auto lit = solveScene(roomsWithAHole(), {"--error", "0.02", "--time-limit", "60"}, &report);
  EXPECT_TRUE(report["reached"].get<bool>());
  EXPECT_LE(report["error"]["texels"].get<double>(), 0.02);
  EXPECT_FALSE(lit.pages.empty());
}

// Shooters whose light is signed leave noise below black where hardly any light comes.
TEST(SolvedScene, NoTexelIsDarkerThanBlack) {
  const auto file = std::filesystem::path(RADIOSITY_SHARED_DIR) / "scenes/godot_living_room_panels.glb";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << file << " is not here";
  const auto folder = std::filesystem::path(RADIOSITY_BINARY_DIR) / "accuracy/SolvedScene.NoTexelIsDarkerThanBlack";
  std::filesystem::create_directories(folder);
  const auto run = runSolve(RADIOSITY_CLIENT, file, folder, {"--error", "0.05", "--time-limit", "20"});
  ASSERT_TRUE(run.exit_code == 0 || run.exit_code == 3) << "exit code " << run.exit_code;
  const auto lit = readLitScene(run.output);
  std::size_t texels = 0;
  for (const auto& texel : findTexels(lit)) {
    const auto value = lit.pages.at(static_cast<std::size_t>(texel.page)).at(texel.x, texel.y);
    ++texels;
    for (int c = 0; c < 3; ++c) EXPECT_GE(value[c], 0.0) << texel.x << ", " << texel.y;
  }
  EXPECT_GT(texels, 10000U);
}

TEST(SolvedScene, EnergyOfTheReportBalances) {
  nlohmann::json report;
  solveScene(test_scenes::cornell(), {"--error", "0.1", "--time-limit", "10", "--texels", "2000"}, &report);
  const auto& e = report.at("energy");
  const double emitted = e.at("emitted");
  const double found = e.at("absorbed").get<double>() + e.at("escaped").get<double>() + e.at("backface").get<double>() +
                       e.at("unshot").get<double>() + e.at("imbalance").get<double>();
  EXPECT_NEAR(found / emitted, 1.0, 1e-5);  // irradiance and shot radiosity are single precision
  EXPECT_LT(std::abs(e.at("imbalance").get<double>()), 0.02 * emitted);
  // lumens: pi x luminance x area
  const auto scene = test_scenes::cornell();
  const auto& light = scene.materials.back().emission_nits;
  const double nits = glm::dot(light, glm::dvec3(0.2126, 0.7152, 0.0722));
  EXPECT_NEAR(emitted, std::numbers::pi * nits * 0.130 * 0.105, 1e-3 * emitted);
}

}  // namespace
}  // namespace radiosity::accuracy
