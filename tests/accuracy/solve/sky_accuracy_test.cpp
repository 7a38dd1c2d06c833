// Skies that are pictures or daylight: the program as a whole against closed forms and the path tracer, which reads
// pictures and draws from them by code of its own. Exit code 3 (time limit) is allowed: the claim is about the result.
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
#include "tests/scenes/hdr_writer.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::TestScene;

constexpr double kPi = std::numbers::pi, kDegree = kPi / 180.0;

std::filesystem::path folder() {
  const auto made = std::filesystem::path(RADIOSITY_BINARY_DIR) / "accuracy" / "sky";
  std::filesystem::create_directories(made);
  return made;
}

Solved solveUnderSky(const TestScene& scene, const std::vector<std::string>& arguments) {
  const auto file = folder() / (scene.name + ".glb");
  test_scenes::writeGlb(scene, file);
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  const auto run = runSolve(RADIOSITY_CLIENT, file, folder() / test->name(), arguments);
  EXPECT_TRUE(run.exit_code == 0 || run.exit_code == 3) << "exit code " << run.exit_code;
  // The lit scene has the sky that was chosen.
  return {readLitScene(run.output, run.output), run.report};
}

std::string picture(const std::string& name, int width, const std::function<glm::dvec3(const glm::dvec3&)>& radiance) {
  const auto file = folder() / (name + ".hdr");
  test_scenes::writeHdr(file, width, width / 2, radiance);
  return file.string();
}

/// A floor of side 2 about the origin that looks up; nothing else.
TestScene floorScene(const std::string& name, double reflectance = 0.0) {
  TestScene scene;
  scene.name = name;
  const auto grey = scene.add({"grey", glm::dvec3(reflectance), glm::dvec3(0.0)});
  scene.objects.push_back({"floor", {}, {{{{-1, 0, -1}, {-1, 0, 1}, {1, 0, 1}, {1, 0, -1}}, grey}}});
  return scene;
}

/// Mean over whole texels.
glm::dvec3 meanOf(const LitScene& lit) {
  glm::dvec3 sum(0.0);
  double area = 0.0;
  for (const auto& texel : findTexels(lit)) {
    sum += texel.footprint.area() * lit.pages.at(static_cast<std::size_t>(texel.page)).at(texel.x, texel.y);
    area += texel.footprint.area();
  }
  return sum / area;
}

TEST(SkyPicture, OfOneColourBringsPiTimesItToAnOpenPlane) {
  const auto sky = picture("even", 64, [](const glm::dvec3&) { return glm::dvec3(1000, 500, 252); });
  const auto solved =
      solveUnderSky(floorScene("even"), {"--error", "0.01", "--time-limit", "20", "--texels", "400", "--sky", sky});
  const auto mean = meanOf(solved.lit);
  EXPECT_NEAR(mean.x / (kPi * 1000.0), 1.0, 0.005);
  EXPECT_NEAR(mean.z / (kPi * 252.0), 1.0, 0.005);
  expectBalance(solved.report);
}

TEST(SkyPicture, IsMultipliedAndTurnsWithItsOptions) {
  const auto sky = picture("turns", 256, [](const glm::dvec3& d) { return glm::dvec3(d.x > 0.0 ? 3.0 : 1.0); });
  auto wall = floorScene("turns");  // looks along -Z
  wall.objects[0].polygons[0].corners = {{-1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {1, -1, 0}};
  const std::vector<std::string> usual{"--error", "0.01", "--time-limit", "20", "--texels", "400", "--sky", sky};
  const auto towards = [&](const char* turn) {
    auto arguments = usual;
    arguments.insert(arguments.end(), {"--sky-strength", "100", "--sky-rotation", turn});
    return meanOf(solveUnderSky(wall, arguments).lit).x / (100.0 * kPi);
  };
  EXPECT_NEAR(towards("0"), 2.0, 0.02) << "half of each";
  EXPECT_NEAR(towards("90"), 3.0, 0.03) << "from +X to -Z";
  EXPECT_NEAR(towards("-90"), 1.0, 0.01);
}

/// Relative RMS of texels from the path tracer, without its own noise.
double rmsOf(const Solved& solved) {
  const auto reference =
      makeReference(solved.lit, {.texel_samples = 4096, .point_samples = 64, .texels = 800, .points = 1});
  const auto accuracy = measure(solved.lit, reference);
  testing::Test::RecordProperty("solver_error", std::to_string(accuracy.solver.solverRms()));
  return accuracy.solver.solverRms();
}

/// A room with a window, or a court where `is_open`, and things in it.
TestScene furnished(const std::string& name) {
  TestScene scene;
  scene.name = name;
  const auto grey = scene.add({"grey", glm::dvec3(0.5, 0.6, 0.7), glm::dvec3(0.0)});
  const auto add = [&](const char* object, std::vector<glm::dvec3> corners) {
    scene.objects.push_back({object, {}, {{std::move(corners), grey}}});
  };
  add("floor", {{-2, 0, -2}, {-2, 0, 2}, {2, 0, 2}, {2, 0, -2}});
  add("back", {{-2, 0, -2}, {2, 0, -2}, {2, 2, -2}, {-2, 2, -2}});
  add("left", {{-2, 0, 2}, {-2, 0, -2}, {-2, 2, -2}, {-2, 2, 2}});
  add("roof", {{-2, 2, -2}, {2, 2, -2}, {2, 2, 0}, {-2, 2, 0}});
  return scene;
}

const glm::dvec3 kSun = glm::normalize(glm::dvec3(0.5, 0.6, 0.6));
/// As a picture of a clear day has it: a sun 20,000 times as bright as the sky, brighter around it, a green ground.
glm::dvec3 sunnyDay(const glm::dvec3& d) {
  const double cosine = glm::dot(d, kSun);
  if (cosine > std::cos(0.8 * kDegree)) return {6e7, 5.5e7, 5e7};
  if (d.y < 0.0) return {300, 500, 200};
  return glm::dvec3(2000, 2500, 4000) + glm::dvec3(30'000.0) * std::exp(-8.0 * std::acos(std::min(1.0, cosine)));
}

TEST(SkyPicture, OfASunnyDayIsWhatThePathTracerHas) {
  const auto sky = picture("sunny", 1024, &sunnyDay);
  const auto solved =
      solveUnderSky(furnished("sunny"), {"--error", "0.01", "--time-limit", "60", "--texels", "3000", "--sky", sky});
  EXPECT_LT(rmsOf(solved), 2.0 * std::max(0.01, solved.report.at("error").at("texels").get<double>()));
  expectBalance(solved.report);
}

TEST(SkyPicture, IsTheSameByShooting) {
  const auto sky = picture("sunny", 1024, &sunnyDay);
  const auto solved = solveUnderSky(furnished("shooting"), {"--error", "0.03", "--time-limit", "60", "--texels", "1500",
                                                            "--sky", sky, "--method", "shooting"});
  EXPECT_LT(rmsOf(solved), 2.0 * std::max(0.03, solved.report.at("error").at("texels").get<double>()));
}

TEST(Daylight, OvercastIsTheSkyOfMoonAndSpencer) {
  auto wall = floorScene("overcast");
  wall.objects[0].polygons[0].corners = {{-1, -1, 0}, {-1, 1, 0}, {1, 1, 0}, {1, -1, 0}};
  const std::vector<std::string> usual{"--error", "0.01", "--time-limit", "20", "--texels", "400", "--sky", "overcast"};
  const double open = meanOf(solveUnderSky(floorScene("overcast"), usual).lit).x,
               upright = meanOf(solveUnderSky(wall, usual).lit).x;
  EXPECT_NEAR(open, 300.0 + 21'000.0 * std::sin(45.0 * kDegree), 80.0);
  // Of the sky (pi / 6 + 4 / 9) / (7 pi / 9) of what the ground has, and half of what that reflects.
  EXPECT_NEAR(upright / open, 0.396 + 0.5 * 0.2, 0.004);
}

// The half shadow of an edge is as wide as the sun is, times how far away the edge is.
TEST(Daylight, ItsSunHasAHalfShadowOfHalfADegree) {
  auto scene = floorScene("penumbra");
  const auto black = scene.add({"edge", glm::dvec3(0.0), glm::dvec3(0.0), 1.0, true});
  scene.objects.push_back({"edge", {}, {{{{-2, 20, -2}, {-2, 20, 2}, {0, 20, 2}, {0, 20, -2}}, black}}});
  auto sun = scene;
  sun.lights.push_back({.kind = test_scenes::Light::Kind::kDirectional,
                        .position = {0, 10, 0},
                        .target = {0, 0, 0},
                        .intensity = glm::dvec3(1000.0),
                        .angle_deg = 0.533});
  // Means over texels, which are compared with the middles of these; others are what lookups between them need. Most of
  // the light, of which the error is a part, is on the edge, and all of the error is on the floor.
  const auto solved = solveUnderSky(sun, {"--error", "0.003", "--time-limit", "30", "--texels", "14400", "--means"});
  const double half = 20.0 * std::tan(0.5 * 0.533 * kDegree);
  double square = 0.0, area = 0.0;
  for (const auto& texel : findTexels(solved.lit)) {
    if (texel.coverage < 0.999 || texel.footprint.pieces[0].corners[0].y > 1.0) continue;
    double x = 0.0;
    for (const auto& piece : texel.footprint.pieces)
      x += (piece.corners[0].x + piece.corners[1].x + piece.corners[2].x) /
           (3.0 * static_cast<double>(texel.footprint.pieces.size()));
    const double at = std::clamp(x / half, -1.0, 1.0);
    const double seen = 0.5 + (at * std::sqrt(1.0 - at * at) + std::asin(at)) / kPi;  // of the disc of the sun
    const double value = solved.lit.pages.at(static_cast<std::size_t>(texel.page)).at(texel.x, texel.y).x;
    square += texel.footprint.area() * std::pow(value / 1000.0 - seen, 2.0);
    area += texel.footprint.area();
  }
  EXPECT_LT(std::sqrt(square / area), 0.01);
  expectBalance(solved.report);
}

}  // namespace
}  // namespace radiosity::accuracy
