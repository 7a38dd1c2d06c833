// Speed of light transport: shots/s and samples/s of scatter, points/s of gather, in rooms of 402 and 3138 polygons
// (the sizes of the two scenes in Lum, Ma and Max 2002), of 102 and of 60000.
//   transport_benchmark --benchmark_filter=scatter/402
#include <benchmark/benchmark.h>

#include "tests/benchmark/built_scenes.h"
#include "tests/gl/scene_builder.h"

namespace radiosity {
namespace {

void report(benchmark::State& state, const solver::TransportCounters& sum) {
  using benchmark::Counter;
  state.counters["samples/s"] = Counter(static_cast<double>(sum.pixels), Counter::kIsRate);
  const auto shots = static_cast<double>(sum.scatter_shots + sum.gather_points);
  state.counters["us_render"] = 1e6 * sum.render_seconds / shots;
  state.counters["us_sum"] = 1e6 * (sum.accumulate_seconds + sum.gather_seconds) / shots;
  state.counters["links"] = static_cast<double>(sum.links) / shots;
  state.counters["Msamples/s/core"] =
      1e-6 * static_cast<double>(sum.pixels) / (sum.render_seconds + sum.accumulate_seconds + sum.gather_seconds);
  state.counters["triangles"] = static_cast<double>(sum.triangles_drawn) / shots;
}

void runBatch(benchmark::State& state, solver::Transport& transport, const scene::PatchScene& scene,
              const solver::ShotBatch& batch) {
  auto flux = test::accumulators(scene);
  solver::TransportCounters sum;
  (void)transport.run(batch, flux);  // tables, targets
  for (auto _ : state) {
    const auto counters = transport.run(batch, flux);
    if (!counters) return state.SkipWithError(counters.error().text().c_str());
    sum += *counters;
  }
  report(state, sum);
  state.SetItemsProcessed(static_cast<std::int64_t>(sum.scatter_shots + sum.gather_points));
}

/// Arguments: polygons, resolution, workers.
void scatter(benchmark::State& state) {
  const auto scene = benchmarks::roomOf(state.range(0));
  const auto carrier = benchmarks::makeTransport(state.range(2), state);
  if (!carrier || !carrier->setScene(scene)) return;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  solver::ShotBatch batch;
  batch.flux_scale = test::kFluxScale;
  for (std::uint32_t i = 0; i < 240; ++i) {  // half from walls, half from furniture
    const auto surfaces = static_cast<std::uint32_t>(scene->surfaces.size());
    const auto surface = i % 2 == 0 ? i / 2 % 6 : 6 + random() % (surfaces - 6);
    batch.scatter.push_back(test::shotFrom(*scene, surface, unit(random), unit(random),
                                           static_cast<std::uint32_t>(state.range(1)), random));
  }
  runBatch(state, *carrier, *scene, batch);
}

/// Arguments: polygons, resolution, workers. A ceiling lamp seen by every leaf, 64 points in 4 shots.
void gather(benchmark::State& state) {
  const auto scene = benchmarks::roomOf(state.range(0));
  const auto carrier = benchmarks::makeTransport(state.range(2), state);
  if (!carrier || !carrier->setScene(scene)) return;
  std::mt19937 random(1);
  std::uniform_real_distribution<float> unit(0.45F, 0.55F);
  solver::ShotBatch batch;
  batch.flux_scale = test::kFluxScale;
  solver::GatherShot shot;
  shot.corner_count = 4;
  shot.corners = {glm::vec3(-0.05F, -0.05F, 0.5F), {-0.05F, 0.05F, 0.5F}, {0.05F, 0.05F, 0.5F}, {0.05F, -0.05F, 0.5F}};
  shot.normal = {0, 0, -1};
  shot.radiosity = {1.0, 1.0, 1.0};
  shot.resolution = static_cast<std::uint32_t>(state.range(1));
  shot.point_count = 16;
  for (std::uint32_t i = 0; i < 4; ++i) {
    shot.first_point = i * 16;
    batch.gather.push_back(shot);
  }
  for (int i = 0; i < 64; ++i) {  // surface 5: the ceiling
    batch.points.push_back(test::shotFrom(*scene, 5, unit(random), unit(random), 64, random).frame);
  }
  runBatch(state, *carrier, *scene, batch);
}

BENCHMARK(scatter)
    ->ArgNames({"polygons", "resolution", "workers"})
    ->ArgsProduct({{102, 402, 3138, 60000}, {32, 64, 128, 256}, benchmarks::workerCounts()})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(gather)
    ->ArgNames({"polygons", "resolution", "workers"})
    ->ArgsProduct({{402, 3138, 60000}, {64, 128, 256}, benchmarks::workerCounts()})
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace radiosity
