// The bake script against the path tracer: units, orientation of the pages, and physics agree. Needs Blender.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <string>

#include "tests/accuracy/solve_run.h"
#include "tests/benchmark/error_series.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"

namespace radiosity::benchmark {
namespace {

/// A mirror, brushed metal, glass, clear and coloured, and paper are in these rooms.
class CyclesBakes : public testing::TestWithParam<const char*> {};

TEST_P(CyclesBakes, ConvergeToThePathTracer) {
  if (std::system("blender --version > /dev/null 2>&1") != 0) GTEST_SKIP() << "Blender is not installed";
  SeriesOptions options;
  options.bake_script = std::filesystem::path(RADIOSITY_SOURCE_DIR) / "tests/benchmark/cycles_bake.py";
  options.cycles_samples = "1,64";  // by count: what a time allows depends on how busy the machine is
  const auto folder = std::filesystem::path(RADIOSITY_BINARY_DIR) / "cycles_test";
  std::filesystem::create_directories(folder);
  const std::string name = GetParam();
  const auto scenes = test_scenes::allScenes();
  const auto scene = std::ranges::find(scenes, name, [](const auto& known) { return known.first; });
  ASSERT_NE(scene, scenes.end());
  test_scenes::writeGlb(scene->second(), folder / (name + ".glb"));
  const auto run =
      accuracy::runSolve(RADIOSITY_CLIENT, folder / (name + ".glb"), folder, {"--error", "0.5", "--texels", "8000"});
  ASSERT_EQ(run.exit_code, 0) << run.last_line;  // only its charts are wanted
  const auto lit = accuracy::readLitScene(run.output, folder / (name + ".glb"));
  const auto reference =
      accuracy::makeReference(lit, {.texel_samples = 1024, .point_samples = 8, .texels = 800, .points = 1});
  const auto series = bakeWithCycles(run.output, lit, reference, options);
  ASSERT_EQ(series.rows.size(), 2U) << series.missing;
  const auto& first = series.rows.front().plain;
  const auto& last = series.rows.back().plain;
  // Pages upside down, or a factor of pi, would leave an error that no number of samples removes. Noise falls with the
  // root of the samples: to an eighth; a half leaves room for lamps in mirrors, which few samples find.
  EXPECT_LT(last.solverRms(), 0.5 * first.solverRms());
  // Mean of 800 texels: the standard error of the bias is the texels' RMS error over the root of 800; 4 of them.
  EXPECT_LT(std::abs(last.bias), 4.0 * last.solverRms() / std::sqrt(800.0) + 0.002);
}

INSTANTIATE_TEST_SUITE_P(Scene, CyclesBakes,
                         testing::Values("cornell", "room_small_mirror", "room_small_brushed", "room_small_glass",
                                         "room_small_tinted", "room_small_shade"),
                         [](const auto& info) { return std::string(info.param); });

TEST(CyclesSeries, WithoutTexelsThatABakeCanBeJudgedOnNothingIsBaked) {
  accuracy::Reference reference;
  reference.texels.resize(3);  // none of them plain
  SeriesOptions options;
  options.blender = "false";  // starting it would leave another reason
  const auto series = bakeWithCycles("no.glb", {}, reference, options);
  EXPECT_TRUE(series.rows.empty());
  EXPECT_NE(series.missing.find("only 0 of 3 texels"), std::string::npos) << series.missing;
}

}  // namespace
}  // namespace radiosity::benchmark
