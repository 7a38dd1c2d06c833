#include "tests/benchmark/built_scenes.h"

#include <malloc.h>

#include <algorithm>
#include <map>
#include <stdexcept>
#include <string>
#include <thread>

#include "server/gpu/gpu_transport.h"
#include "server/scene/document.h"
#include "tests/gl/scene_builder.h"

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
