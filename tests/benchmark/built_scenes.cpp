#include "tests/benchmark/built_scenes.h"

#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>

#include "server/gpu/workers/gpu_transport.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "tests/gl/scene_builder.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::benchmarks {
namespace {

template <typename T>
T must(Result<T> result) {
  if (!result) throw std::runtime_error(result.error().text());
  return std::move(*result);
}

}  // namespace

const scene::Scene& importedScene(std::int64_t which) {
  static std::map<std::int64_t, scene::Scene> scenes;
  const auto found = scenes.find(which);
  if (found != scenes.end()) return found->second;
  const std::string file = std::string(RADIOSITY_BINARY_DIR) + "/scenes/" + kSceneNames[which] + ".glb";
  return scenes.emplace(which, must(scene::importScene(must(scene::loadDocument(file))))).first->second;
}

scene::ChartOptions chartOptions(std::int64_t which) {
  scene::ChartOptions options;
  if (which == kSmallRoom) options.texel_budget = 13742;
  if (which == kSeminarRoom) options.texel_budget = 27382;
  return options;
}

const Patches& patchesOf(std::int64_t which) {
  static std::map<std::int64_t, Patches> all;
  const auto found = all.find(which);
  if (found != all.end()) return found->second;
  Patches made;
  made.patches = std::make_shared<const scene::PatchScene>(
      must(scene::buildPatchScene(importedScene(which), chartOptions(which))));
  made.materials = scene::shadePatches(importedScene(which), *made.patches);
  return all.emplace(which, std::move(made)).first->second;
}

const Patches& lampsOf(std::int64_t lamps) {
  static std::map<std::int64_t, Patches> all;
  const auto found = all.find(lamps);
  if (found != all.end()) return found->second;
  std::mt19937 random(7);
  std::uniform_real_distribution<double> uniform(-1.0, 1.0);
  const auto point = [&] { return glm::dvec3(uniform(random), uniform(random), uniform(random)); };
  scene::Primitive sparks;
  const double size = 0.8 / std::sqrt(static_cast<double>(lamps));
  for (std::int64_t i = 0; i < lamps; ++i) {
    const auto centre = 1.3 * point();
    for (int k = 0; k < 3; ++k) {
      sparks.indices.push_back(static_cast<std::uint32_t>(sparks.positions.size()));
      sparks.positions.push_back(centre + size * point());
    }
  }
  scene::Scene room;
  scene::Material shines;
  shines.double_sided = true;
  shines.emission = glm::vec3(20.0F);
  shines.base_color = glm::vec4(0.5F, 0.5F, 0.5F, 1.0F);
  scene::Material grey;
  grey.base_color = glm::vec4(0.6F, 0.6F, 0.6F, 1.0F);
  scene::test::place(room, scene::test::box(glm::dvec3(-2.0), glm::dvec3(2.0), true), glm::dmat4(1.0), grey);
  scene::test::place(room, std::move(sparks), glm::dmat4(1.0), shines);
  scene::ChartOptions options;
  options.texel_budget = 24'000;
  Patches made;
  made.patches = std::make_shared<const scene::PatchScene>(must(scene::buildPatchScene(room, options)));
  made.materials = scene::shadePatches(room, *made.patches);
  return all.emplace(lamps, std::move(made)).first->second;
}

std::shared_ptr<const scene::PatchScene> roomOf(std::int64_t polygons) {
  static std::map<std::int64_t, std::shared_ptr<const scene::PatchScene>> rooms;
  auto& found = rooms[polygons];
  if (!found) found = test::randomRoom(static_cast<std::uint32_t>(polygons), polygons <= 402 ? 13742 : 27382, 5);
  return found;
}

std::unique_ptr<solver::Transport> makeTransport(std::int64_t workers, benchmark::State& state) {
  auto made = workers == 0 ? gpu::makeInProcessTransport()
                           : gpu::makeWorkerTransport({static_cast<int>(workers), "/proc/self/exe"});
  if (made) return std::move(*made);
  state.SkipWithError(made.error().text().c_str());
  return nullptr;
}

std::vector<std::int64_t> workerCounts() {
  const auto cores = static_cast<std::int64_t>(std::max(1U, std::thread::hardware_concurrency()));
  std::vector<std::int64_t> counts{0};
  for (std::int64_t n = 1; n < cores; n *= 2) counts.push_back(n);
  counts.push_back(cores);
  return counts;
}

std::size_t heapBytes() {
  const auto heap = mallinfo2();
  return heap.uordblks + heap.hblkhd;
}

}  // namespace radiosity::benchmarks
