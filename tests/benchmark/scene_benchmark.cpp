// From triangles to patches: import, charts, shading, pages; and how much memory a patch takes.
#include <benchmark/benchmark.h>

#include <vector>

#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/lightmap/lightmap.h"
#include "server/scene/lightmap/texel_fit.h"
#include "server/scene/shading/shade.h"
#include "server/solver/pipeline/make_solver.h"
#include "server/solver/solver.h"
#include "tests/benchmark/built_scenes.h"
#include "tests/benchmark/whole_solve.h"

namespace radiosity::benchmarks {
namespace {

void label(benchmark::State& state) { state.SetLabel(kSceneNames[state.range(0)]); }

/// buildPatchScene: flatten, charts, packing, coverage, burial. Arguments: scene, texel budget in thousands.
void charts(benchmark::State& state) {
  label(state);
  auto options = chartOptions(state.range(0));
  options.texel_budget = static_cast<std::uint64_t>(state.range(1)) * 1000;
  std::size_t leaves = 0;
  for (auto _ : state) {
    const auto patches = scene::buildPatchScene(importedScene(state.range(0)), options);
    if (!patches) return state.SkipWithError(patches.error().text().c_str());
    leaves += patches->leaves.size();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(leaves));
}

/// Emission and reflectance of every node from the materials.
void shade(benchmark::State& state) {
  label(state);
  const auto& patches = *patchesOf(state.range(0)).patches;
  for (auto _ : state) benchmark::DoNotOptimize(scene::shadePatches(importedScene(state.range(0)), patches));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(patches.leaves.size()));
}

/// Of irradiance with noise: what a publication costs before its pages.
void fit(benchmark::State& state) {
  label(state);
  const auto& patches = *patchesOf(state.range(0)).patches;
  scene::LeafLight light{std::vector<glm::vec3>(patches.nodeCount()), std::vector<glm::vec3>(patches.nodeCount())};
  for (std::size_t n = 0; n < patches.nodeCount(); ++n) {
    light.mean[n] = glm::vec3(1.0F + 0.1F * static_cast<float>(n % 7));
    light.difference[n] = glm::vec3(0.1F * static_cast<float>(n % 5));
  }
  for (auto _ : state) benchmark::DoNotOptimize(scene::fitTexels(patches, light));
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(patches.leaves.size()));
}

/// Irradiance into finished pages with their mips: what a publication costs before encoding, and what is saved while
/// no client watches.
void pages(benchmark::State& state) {
  label(state);
  const auto& patches = *patchesOf(state.range(0)).patches;
  const std::vector<glm::vec3> irradiance(patches.nodeCount(), glm::vec3(1.0F));
  for (auto _ : state) {
    auto made = scene::assemblePages(patches, irradiance);
    for (auto& page : made) {
      while (page.irradiance.width > 1 || page.irradiance.height > 1) page = scene::coarserMip(page);
    }
    benchmark::DoNotOptimize(made.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(patches.leaves.size()));
}

/// Bytes that stay allocated, by leaf patch: the patch scene, what materials make of it, and a solver at a stated 2 %
/// with its links and rays. Workers and OpenGL not included.
void memory(benchmark::State& state) {
  label(state);
  (void)importedScene(state.range(0));
  const auto transport = makeTransport(1, state);
  if (!transport) return;
  double scene_bytes = 0, material_bytes = 0, solver_bytes = 0, leaves = 1, nodes = 1;
  for (auto _ : state) {
    const auto before = heapBytes();
    auto built = scene::buildPatchScene(importedScene(state.range(0)), chartOptions(state.range(0)));
    if (!built) return state.SkipWithError(built.error().text().c_str());
    const auto patches = std::make_shared<const scene::PatchScene>(std::move(*built));
    const auto with_scene = heapBytes();
    const auto materials = scene::shadePatches(importedScene(state.range(0)), *patches);
    const auto with_materials = heapBytes();
    if (const auto set = transport->setScene(patches); !set) return state.SkipWithError(set.error().text().c_str());
    const auto with_transport = heapBytes();
    solver::SolverSettings settings;
    settings.target_error = 0.02;
    const auto solver = solver::makeSolver(patches, materials, *transport, settings);
    solveToEnd(state, *solver);
    solver_bytes = static_cast<double>(heapBytes() - with_transport);
    material_bytes = static_cast<double>(with_materials - with_scene);
    scene_bytes = static_cast<double>(with_scene - before);
    leaves = static_cast<double>(patches->leaves.size());
    nodes = static_cast<double>(patches->nodeCount());
  }
  state.counters["patches"] = leaves;
  state.counters["nodes_a_patch"] = nodes / leaves;
  state.counters["B_scene"] = scene_bytes / leaves;
  state.counters["B_materials"] = material_bytes / leaves;
  state.counters["B_solver"] = solver_bytes / leaves;
}

BENCHMARK(charts)
    ->ArgNames({"scene", "kilotexels"})
    ->ArgsProduct({{kCornell, kSmallRoom, kSeminarRoom}, {16, 64, 256}})
    ->Unit(benchmark::kMillisecond);
BENCHMARK(shade)->ArgNames({"scene"})->DenseRange(kCornell, kSeminarRoom)->Unit(benchmark::kMillisecond);
BENCHMARK(fit)->ArgNames({"scene"})->DenseRange(kCornell, kSeminarRoom)->Unit(benchmark::kMillisecond);
BENCHMARK(pages)->ArgNames({"scene"})->DenseRange(kCornell, kSeminarRoom)->Unit(benchmark::kMillisecond);
BENCHMARK(memory)
    ->ArgNames({"scene"})
    ->DenseRange(kCornell, kSeminarRoom)
    ->Iterations(1)
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace radiosity::benchmarks
