// Large scenes. Disabled by default: run by hand with --gtest_also_run_disabled_tests --gtest_filter='Large*'.
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <chrono>
#include <cstdio>

#include "server/scene/charts/build.h"
#include "server/scene/lightmap/lightmap.h"
#include "server/scene/shading/shade.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

class Stopwatch {
 public:
  double lap() {
    const auto now = std::chrono::steady_clock::now();
    const double seconds = std::chrono::duration<double>(now - last_).count();
    last_ = now;
    return seconds;
  }

 private:
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

double peakGib() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<double>(usage.ru_maxrss) / 1048576.0;
}

void report(const Scene& scene, const ChartOptions& options) {
  Stopwatch watch;
  const auto patches = buildPatchScene(scene, options);
  ASSERT_TRUE(patches) << patches.error().text();
  const double build = watch.lap();
  const PatchMaterials materials = shadePatches(scene, *patches);
  const double shade = watch.lap();
  const auto pages = assemblePages(*patches, std::vector<glm::vec3>(patches->nodeCount(), glm::vec3(1.0F)));
  std::printf(
      "%zu triangles, %zu surfaces, %zu leaves, %zu pages: build %.2f s, shade %.2f s, pages %.2f s, peak %.2f GiB\n",
      patches->triangles.size(), patches->surfaces.size(), coveredLeaves(*patches), pages.size(), build, shade,
      watch.lap(), peakGib());
  EXPECT_NEAR(leafArea(*patches) / triangleArea(scene), 1.0, 1e-4);
}

/// size x size quads with a wavy height.
Primitive terrain(int size, double height, double waves) {
  Primitive p;
  for (int j = 0; j <= size; ++j)
    for (int i = 0; i <= size; ++i) {
      const double x = static_cast<double>(i) / size, z = static_cast<double>(j) / size;
      p.positions.emplace_back(x, height * std::sin(waves * x) * std::cos(waves * z), z);
    }
  const auto id = [&](int i, int j) { return static_cast<std::uint32_t>(j * (size + 1) + i); };
  for (int j = 0; j < size; ++j)
    for (int i = 0; i < size; ++i) {
      p.indices.insert(p.indices.end(), {id(i, j), id(i, j + 1), id(i + 1, j + 1)});
      p.indices.insert(p.indices.end(), {id(i, j), id(i + 1, j + 1), id(i + 1, j)});
    }
  return p;
}

TEST(Large, DISABLED_FlatGridOfAMillionTriangles) { report(sceneOf(terrain(708, 0.0, 0.0)), {}); }
TEST(Large, DISABLED_WavyGridOfAMillionTriangles) { report(sceneOf(terrain(708, 0.05, 40.0)), {}); }
TEST(Large, DISABLED_SphereOfAMillionTriangles) { report(sceneOf(icoSphere(1.0, 8)), {}); }
TEST(Large, DISABLED_WallOf8192x8192Texels) {
  ChartOptions options;
  options.texel_size_m = 1.0 / 8192;
  options.max_page_size = 8196;
  report(sceneOf(floorQuad(1.0)), options);
}
TEST(Large, DISABLED_HundredThousandQuads) {
  Scene scene;
  Primitive p;
  for (int i = 0; i < 316; ++i)
    for (int j = 0; j < 316; ++j) {
      const double x = i, z = j, y = 0.1 * ((i * 7 + j * 13) % 11);
      addQuad(p, {x, y, z}, {x, y, z + 0.9}, {x + 0.9, y, z + 0.9}, {x + 0.9, y, z});
    }
  report(sceneOf(p), {});
}

}  // namespace
}  // namespace radiosity::scene::test
