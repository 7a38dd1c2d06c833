// Scenes that others made, where the shared folder has them.
#include <gtest/gtest.h>

#include <cstdio>
#include <cstdlib>
#include <filesystem>

#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/lightmap/lightmap.h"
#include "server/scene/shading/shade.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

namespace fs = std::filesystem;

std::vector<fs::path> sharedScenes() {
  const char* folder = std::getenv("RADIOSITY_SHARED_DIR");
  const fs::path root = fs::path(folder != nullptr ? folder : RADIOSITY_SHARED_DIR) / "scenes";
  std::vector<fs::path> files;
  if (!fs::exists(root)) return files;
  for (const auto& entry : fs::recursive_directory_iterator(root))
    if (entry.path().extension() == ".glb" || entry.path().extension() == ".gltf") files.push_back(entry.path());
  std::ranges::sort(files);
  return files;
}

void expectUsable(const Scene& scene, const PatchScene& patches) {
  const double area = triangleArea(scene);
  const double front = leafArea(patches);
  EXPECT_LE(front, area * 1.0001);
  EXPECT_GE(front, area * 0.5) << "more than half of the scene is buried";
  for (const float a : patches.node_area) ASSERT_TRUE(std::isfinite(a) && a >= 0.0F);
  for (const Surface& s : patches.surfaces) {
    ASSERT_LE(s.place[0].x + s.width, patches.pages[s.place[0].page].width);
    ASSERT_LE(s.place[0].y + s.height, patches.pages[s.place[0].page].height);
  }
  const PatchMaterials materials = shadePatches(scene, patches);
  for (std::uint32_t n = 0; n < patches.nodeCount(); ++n) {
    const glm::vec3 rho = materials.reflectance[n], e = materials.emission[n];
    for (int c = 0; c < 3; ++c) {
      ASSERT_TRUE(rho[c] >= 0.0F && rho[c] <= 0.999F);
      ASSERT_TRUE(e[c] >= 0.0F && std::isfinite(e[c]));
    }
  }
  const auto pages = assemblePages(patches, std::vector<glm::vec3>(patches.nodeCount(), glm::vec3(1.0F)));
  const auto isBlack = [&](std::size_t page, int x, int y) {
    const auto inside = [](std::uint32_t at, int from) {
      return from >= static_cast<int>(at) && from < static_cast<int>(at + PatchScene::kBlackSide);
    };
    return page == patches.black.page && inside(patches.black.x, x) && inside(patches.black.y, y);
  };
  for (std::size_t p = 0; p < pages.size(); ++p)
    for (int y = 0; y < pages[p].irradiance.height; ++y)
      for (int x = 0; x < pages[p].irradiance.width; ++x) {
        const auto i = pages[p].irradiance.index(x, y);
        if (pages[p].coverage[i] > 0.0F) {
          ASSERT_NEAR(pages[p].irradiance.pixels[i].x, isBlack(p, x, y) ? 0.0F : 1.0F, 1e-4F);
        }
      }
}

TEST(RealScenes, BecomePatchesThatAddUp) {
  const auto files = sharedScenes();
  if (files.empty()) GTEST_SKIP() << "no shared scenes here (set RADIOSITY_SHARED_DIR)";
  for (const fs::path& file : files) {
    const auto document = loadDocument(file);
    if (!document) continue;  // the importer's own tests judge that
    const auto scene = importScene(*document);
    if (!scene) continue;
    SCOPED_TRACE(file.filename().string());
    const auto patches = buildPatchScene(*scene, {});
    ASSERT_TRUE(patches) << patches.error().text();
    if (patches->triangles.empty()) continue;
    std::printf("%-36s %7zu triangles %6zu charts %7zu leaves %5.1f %% buried, %zu seams, page %ux%u\n",
                file.filename().c_str(), patches->triangles.size(), patches->surfaces.size(), coveredLeaves(*patches),
                100.0 * (1.0 - leafArea(*patches) / triangleArea(*scene)), patches->seams.size(),
                patches->pages[0].width, patches->pages[0].height);
    for (const auto& warning : patches->warnings) std::printf("    %s\n", warning.c_str());
    expectUsable(*scene, *patches);
  }
}

}  // namespace
}  // namespace radiosity::scene::test
