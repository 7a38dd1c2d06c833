// The parts of a shot, apart: culling, drawing with its readback, and turning an image into flux.
#include <benchmark/benchmark.h>

#include "server/gpu/draw/hemicube_renderer.h"
#include "server/gpu/gather/scatter_accumulator.h"
#include "tests/benchmark/built_scenes.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::benchmarks {
namespace {

constexpr std::size_t kShooters = 32;

std::vector<solver::ScatterShot> shooters(const scene::PatchScene& scene, std::uint32_t resolution) {
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  std::vector<solver::ScatterShot> shots;
  for (std::uint32_t i = 0; i < kShooters; ++i) {
    const auto surface = static_cast<std::uint32_t>(random() % scene.surfaces.size());
    shots.push_back(test::shotFrom(scene, surface, unit(random), unit(random), resolution, random));
  }
  return shots;
}

/// A context with a scene, and one image a shooter.
struct Stage {
  std::unique_ptr<gpu::EglContext> context;
  std::optional<gpu::HemicubeRenderer> renderer;
  std::vector<std::uint32_t> pixels;

  static std::unique_ptr<Stage> make(std::int64_t scene, benchmark::State& state) {
    auto stage = std::make_unique<Stage>();
    auto context = gpu::EglContext::create();
    if (!context) return state.SkipWithError(context.error().text().c_str()), nullptr;
    stage->context = std::move(*context);
    auto renderer = gpu::HemicubeRenderer::create(*stage->context);
    if (!renderer) return state.SkipWithError(renderer.error().text().c_str()), nullptr;
    auto uploaded = gpu::GpuScene::upload(*stage->context, patchesOf(scene).patches);
    if (!uploaded) return state.SkipWithError(uploaded.error().text().c_str()), nullptr;
    stage->renderer.emplace(std::move(*renderer));
    if (const auto set = stage->renderer->setScene(std::move(*uploaded)); !set) {
      return state.SkipWithError(set.error().text().c_str()), nullptr;
    }
    return stage;
  }

  std::span<const std::uint32_t> image(const solver::ScatterShot& shot, solver::TransportCounters& counters) {
    const gpu::HemicubeView view{shot.frame, shot.level_bias};
    renderer->render(gpu::HemicubePass::kNodes, shot.resolution, {&view, 1}, counters, pixels);
    return pixels;
  }
};

/// Which triangles each face may see. kept_%: of triangles times faces, what is left to draw, or to look at once more.
void cull(benchmark::State& state) {
  state.SetLabel(kSceneNames[state.range(0)]);
  const auto& patches = *patchesOf(state.range(0)).patches;
  gpu::TriangleCuller culler(patches);
  const auto shots = shooters(patches, 64);
  gpu::TriangleCuller::Selection selection;
  std::size_t kept = 0, next = 0;
  for (auto _ : state) {
    culler.select(shots[next++ % shots.size()].frame, 64, selection);
    for (const auto* lists : {&selection.first, &selection.second}) {
      for (const auto& list : *lists) kept += list.count / 3;
    }
  }
  const auto tested = static_cast<double>(state.iterations()) * static_cast<double>(culler.triangleCount());
  state.SetItemsProcessed(static_cast<std::int64_t>(tested));
  state.counters["kept_%"] = 100.0 * static_cast<double>(kept) / (tested * RAD_FACES);
}

/// Culling, drawing and readback of one hemicube at a time. Arguments: scene, resolution.
void draw(benchmark::State& state) {
  state.SetLabel(kSceneNames[state.range(0)]);
  const auto stage = Stage::make(state.range(0), state);
  if (!stage) return;
  const auto shots = shooters(*patchesOf(state.range(0)).patches, static_cast<std::uint32_t>(state.range(1)));
  solver::TransportCounters counters;
  std::size_t next = 0;
  for (auto _ : state) benchmark::DoNotOptimize(stage->image(shots[next++ % shots.size()], counters).data());
  state.counters["samples/s"] = benchmark::Counter(static_cast<double>(counters.pixels), benchmark::Counter::kIsRate);
}

/// An image into flux at nodes. Arguments: scene, resolution. Items are pixels.
void accumulate(benchmark::State& state) {
  state.SetLabel(kSceneNames[state.range(0)]);
  const auto stage = Stage::make(state.range(0), state);
  if (!stage) return;
  const auto& patches = *patchesOf(state.range(0)).patches;
  auto shots = shooters(patches, static_cast<std::uint32_t>(state.range(1)));
  solver::TransportCounters counters;
  std::vector<std::vector<std::uint32_t>> images;
  for (auto& shot : shots) {
    const auto ids = stage->image(shot, counters);
    images.emplace_back(ids.begin(), ids.end());
    shot.flux = {1.0, 1.0, 1.0};
  }
  gpu::ScatterAccumulator accumulator(patches.nodeCount());
  gpu::FluxStore store(patches.nodeCount());
  gpu::WeightCache weights;
  const auto sink = store.sink();
  std::size_t next = 0, pixels = 0;
  counters = {};
  for (auto _ : state) {
    const auto& shot = shots[next % shots.size()];
    const auto& image = images[next++ % images.size()];
    accumulator.accumulate(image, weights.get(shot.resolution, shot.frame.lattice), shot, test::kFluxScale / (1 << 20),
                           sink, counters);
    pixels += image.size();
  }
  state.SetItemsProcessed(static_cast<std::int64_t>(pixels));
  state.counters["links"] = static_cast<double>(counters.links) / static_cast<double>(state.iterations());
}

BENCHMARK(cull)->ArgNames({"scene"})->DenseRange(kCornell, kSeminarRoom)->Unit(benchmark::kMicrosecond);
BENCHMARK(draw)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->ArgNames({"scene", "resolution"})
    ->ArgsProduct({{kCornell, kSmallRoom, kSeminarRoom}, {64, 128, 256}})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(accumulate)
    ->ArgNames({"scene", "resolution"})
    ->ArgsProduct({{kCornell, kSmallRoom, kSeminarRoom}, {64, 256}})
    ->Unit(benchmark::kMicrosecond);

}  // namespace
}  // namespace radiosity::benchmarks
