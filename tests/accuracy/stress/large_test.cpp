// Large scenes through the whole solve: bounded memory, progress, no stall. Disabled by default: run by hand with
// --gtest_also_run_disabled_tests --gtest_filter='LargeSolve*'.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>

#include "common/memory_limit.h"
#include "server/scene/charts/build.h"
#include "tests/accuracy/stress/stress_solve.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::TestScene;

double peakGib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1048576.0;
}

double secondsSince(std::chrono::steady_clock::time_point begin) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
}

/// Solves for `seconds` and prints what came of it.
void report(const char* name, const Loaded& loaded, double seconds, double most_gib) {
  const double built = peakGib();
  Solve solve(loaded);
  const auto begin = std::chrono::steady_clock::now();
  double longest = 0.0, first = 0.0;
  while (secondsSince(begin) < seconds) {
    const auto step = std::chrono::steady_clock::now();
    const bool done = solve.run(1);
    longest = std::max(longest, secondsSince(step));
    double light = 0.0;
    if (first == 0.0) {
      solve.eachLeaf([&](std::uint32_t, double area, const glm::dvec3& h) { light += area * h.x; });
      if (light > 0.0) first = secondsSince(begin);
    }
    if (done) break;
  }
  solve.solver().assess();
  expectSound(solve);
  const auto e = solve.solver().energy();
  std::printf(
      "%s: %zu triangles, %zu leaves; after %.1f s: stated %.4f, %llu shots, first light %.2f s, longest step %.2f s, "
      "absorbed %.3f of emitted; peak %.2f GiB built, %.2f GiB solved\n",
      name, loaded.patches->triangles.size(), loaded.patches->leaves.size(), secondsSince(begin),
      solve.solver().error().total, static_cast<unsigned long long>(solve.solver().shots()), first, longest,
      e.absorbed[0] / e.emitted[0], built, peakGib());
  EXPECT_GT(solve.solver().shots(), 0U);
  EXPECT_GT(first, 0.0) << "no light after " << seconds << " s";
  EXPECT_LT(peakGib(), most_gib);
}

/// A floor of waves, `cells` x `cells` x 2 triangles, under a lamp.
TestScene waves(int cells) {
  TestScene scene;
  scene.name = "waves";
  const auto grey = scene.add({"grey", glm::dvec3(0.5), glm::dvec3(0.0)});
  const auto light = scene.add({"light", glm::dvec3(0.0), glm::dvec3(100.0)});
  test_scenes::Object floor{"floor", {}, {}};
  const auto at = [&](int i, int j) {
    const double x = static_cast<double>(i) / cells, z = static_cast<double>(j) / cells;
    return glm::dvec3(x, 0.03 * std::sin(40.0 * x) * std::cos(40.0 * z), z);
  };
  for (int j = 0; j < cells; ++j) {
    for (int i = 0; i < cells; ++i) {
      floor.polygons.push_back({{at(i, j), at(i, j + 1), at(i + 1, j + 1)}, grey});
      floor.polygons.push_back({{at(i, j), at(i + 1, j + 1), at(i + 1, j)}, grey});
    }
  }
  scene.objects.push_back(std::move(floor));
  scene.objects.push_back(
      {"lamp", {}, {{{{0.3, 0.8, 0.3}, {0.7, 0.8, 0.3}, {0.7, 0.8, 0.7}, {0.3, 0.8, 0.7}}, light}}});
  return scene;
}

TEST(LargeSolve, DISABLED_WavesOfAMillionTriangles) { report("waves", load(waves(708), 16'000), 60.0, 8.0); }

/// One wall of `texels` x `texels` under a lamp, in one lightmap.
void reportWall(const char* name, int texels, double most_gib) {
  // Scenes whose leaves would fill three quarters of the memory are refused: 512 bytes each.
  if (512.0 * texels * texels > 0.75 * static_cast<double>(memoryLimitBytes()))
    GTEST_SKIP() << "this machine has too little memory for it";
  TestScene scene;
  scene.name = "wall";
  const auto grey = scene.add({"grey", glm::dvec3(0.5), glm::dvec3(0.0)});
  const auto light = scene.add({"light", glm::dvec3(0.0), glm::dvec3(100.0)});
  scene.objects.push_back({"wall", {}, {{{{0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}}, grey}}});
  scene.objects.push_back(
      {"lamp", {}, {{{{0.4, 0.5, 0.4}, {0.6, 0.5, 0.4}, {0.6, 0.5, 0.6}, {0.4, 0.5, 0.6}}, light}}});
  scene::ChartOptions charts;
  charts.texel_size_m = 1.0 / texels;
  charts.max_page_size = static_cast<std::uint32_t>(texels) + 4;
  report(name, loadGlb(test_scenes::encodeGlb(scene), charts), 60.0, most_gib);
}

TEST(LargeSolve, DISABLED_WallOf2048x2048Texels) { reportWall("wall 2048", 2048, 3.0); }
TEST(LargeSolve, DISABLED_WallOf4096x4096Texels) { reportWall("wall 4096", 4096, 8.0); }
TEST(LargeSolve, DISABLED_WallOf8192x8192Texels) { reportWall("wall 8192", 8192, 24.0); }

}  // namespace
}  // namespace radiosity::accuracy
