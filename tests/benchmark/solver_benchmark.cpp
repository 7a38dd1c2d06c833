// The solver: push-pull, and whole solves by number of workers.
#include <benchmark/benchmark.h>

#include <random>
#include <string>

#include "server/solver/shooting/state.h"
#include "tests/benchmark/built_scenes.h"
#include "tests/benchmark/whole_solve.h"

namespace radiosity::benchmarks {
namespace {

void label(benchmark::State& state) { state.SetLabel(kSceneNames[state.range(0)]); }

enum DirtySides : std::int64_t { kNone, kOne, kAll };

/// Arguments: scene, sides that have received light since the last time. The skip: clean sides cost nothing.
void pushPull(benchmark::State& state) {
  const auto& [patches, materials] = patchesOf(state.range(0));
  constexpr const char* kDirty[] = {"no side dirty", "one side dirty", "all sides dirty"};
  state.SetLabel(std::string(kSceneNames[state.range(0)]) + ", " + kDirty[state.range(1)]);
  solver::RadiosityState radiosity(patches, materials);
  solver::FluxAccumulators batch;
  batch.reset(patches->nodeCount());
  std::mt19937 random(1);
  for (const auto& side : radiosity.sides()) {
    for (std::uint32_t i = 0; i < side.node_count / 4 + 1; ++i) {
      batch.node[i % 2][side.first_node + random() % side.node_count] = {1000, 1000, 1000};
    }
    if (state.range(1) == kOne) break;
  }
  for (auto _ : state) {
    if (state.range(1) != kNone) {
      state.PauseTiming();
      radiosity.receive(batch);
      state.ResumeTiming();
    }
    radiosity.pushPullAll();
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(patches->nodeCount()));
}

/// Adding a batch that touched everything.
void receive(benchmark::State& state) {
  label(state);
  const auto& [patches, materials] = patchesOf(state.range(0));
  solver::RadiosityState radiosity(patches, materials);
  solver::FluxAccumulators batch;
  batch.reset(patches->nodeCount());
  for (auto& half : batch.node) std::fill(half.begin(), half.end(), solver::Flux3{1, 1, 1});
  for (auto _ : state) radiosity.receive(batch);
  state.SetItemsProcessed(state.iterations() * 2 * static_cast<std::int64_t>(patches->nodeCount()));
}

/// Arguments: scene, workers (0: in this process).
void solve(benchmark::State& state) {
  label(state);
  solver::SolverSettings settings;
  settings.target_error = kSolveGoal;
  runSolve(state, patchesOf(state.range(0)), state.range(1), settings);
}

/// Arguments: lamps, all of them together of one power.
void solveManyLamps(benchmark::State& state) {
  solver::SolverSettings settings;
  settings.target_error = 0.02;
  runSolve(state, lampsOf(state.range(0)), 2, settings);
}

BENCHMARK(pushPull)
    ->ArgNames({"scene", "dirty"})
    ->ArgsProduct({{kCornell, kSmallRoom, kSeminarRoom}, {kNone, kOne, kAll}})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(receive)->ArgNames({"scene"})->DenseRange(kCornell, kSeminarRoom)->Unit(benchmark::kMicrosecond);
BENCHMARK(solve)
    ->ArgNames({"scene", "workers"})
    ->ArgsProduct({{kCornell, kSmallRoom, kSeminarRoom}, workerCounts()})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

BENCHMARK(solveManyLamps)
    ->ArgNames({"lamps"})
    ->Arg(64)
    ->Arg(125)
    ->Arg(250)
    ->Arg(500)
    ->Arg(1000)
    ->Arg(2000)
    ->Arg(4000)
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace radiosity::benchmarks
