// Light that is only seen through glow: a lamp in a closed paper shade lights a room, as the path tracer has it.
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <numbers>

#include "tests/accuracy/solve_run.h"
#include "tests/accuracy/surface.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

/// 4 x 3 x 4 m with a table, and over it a cylinder of paper, closed by paper, around a shining box.
test_scenes::TestScene shadedRoom() {
  test_scenes::TestScene scene;
  scene.name = "shaded_room";
  const auto white = scene.add({"white", glm::dvec3(0.7), glm::dvec3(0.0)});
  const auto red = scene.add({"red", {0.6, 0.2, 0.15}, glm::dvec3(0.0)});
  const auto bulb = scene.add({"bulb", glm::dvec3(0.5), glm::dvec3(800.0)});
  test_scenes::Material paper{"paper", glm::dvec3(0.8), glm::dvec3(0.0)};
  paper.diffuse_transmission = 0.6;
  paper.transmitted = {0.95, 0.85, 0.6};
  const auto shade = scene.add(paper);
  test_scenes::Object room{"room", {}, {}}, lamp{"lamp", {}, {}}, table{"table", {}, {}}, drum{"shade", {}, {}};
  appendBox(room, {-2, 0, -2}, {2, 3, 2}, {red, white, white, white, white, white}, test_scenes::kNoFace, true);
  appendBox(table, {-0.6, 0.7, -0.4}, {0.6, 0.75, 0.4}, test_scenes::allFaces(white));
  appendBox(lamp, {-0.06, 1.6, -0.06}, {0.06, 1.8, 0.06}, test_scenes::allFaces(bulb));
  appendCylinder(drum, {0, 1.4, 0}, 0.35, 0.6, 16, shade);
  scene.objects = {room, table, lamp, drum};
  scene.camera = {{1.6, 1.8, 1.8}, {0, 1.2, 0}, 0.9, 0.0};
  return scene;
}

TEST(Translucent, ALampInAPaperShadeLightsTheRoom) {
  const auto folder = std::filesystem::path(RADIOSITY_BINARY_DIR) / "accuracy" / "translucent";
  std::filesystem::create_directories(folder);
  const auto file = folder / "shaded_room.glb";
  test_scenes::writeGlb(shadedRoom(), file);
  const auto run = runSolve(RADIOSITY_CLIENT, file, folder, {"--error", "0.03", "--texels", "8000"});
  ASSERT_EQ(run.exit_code, 0) << run.last_line;
  const auto lit = readLitScene(run.output, file);
  const auto points = makePoints(lit.traced(), 2000, 512, 1);
  const auto error = compareSurface(lit, points).error;
  EXPECT_GT(error.compared, 1000U);
  EXPECT_NEAR(error.mean_ratio, 1.0, 0.02);
  // Of bilinear lookups, as rooms of such texels have it.
  EXPECT_LT(error.rms(), 0.12);
  // Rays alone find so small a thing by chance, which leaves blotches on walls.
  constexpr double kLampSides = 6.0;
  EXPECT_GT(run.report["counters"]["links.shooters"].get<double>(), kLampSides) << "the shade is shot from";
  const auto& energy = run.report["energy"];
  const double emitted = energy["emitted"].get<double>();
  EXPECT_NEAR(energy["absorbed"].get<double>() / emitted, 1.0, 0.02) << "a closed room keeps its light";
}

}  // namespace
}  // namespace radiosity::accuracy
