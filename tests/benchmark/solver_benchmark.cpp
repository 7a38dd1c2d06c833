// The solver: push-pull, whole rounds by number of workers, and what its skips save. A round is a fixed amount of work
// (the same seed shoots the same shots), so seconds compare; its stated error says what they bought.
#include <benchmark/benchmark.h>

#include <functional>
#include <random>
#include <string>

#include "server/solver/solver.h"
#include "tests/benchmark/built_scenes.h"

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

void reportRound(benchmark::State& state, const solver::Solver& solver) {
  const auto& transport = solver.transportCounters();
  const auto& planner = solver.plannerCounters();
  state.counters["shooters"] = static_cast<double>(planner.shooters);
  state.counters["shots"] = static_cast<double>(solver.shots());
  state.counters["stated_%"] = 100.0 * solver.error().total;
  state.counters["Mpixels"] = 1e-6 * static_cast<double>(transport.pixels);
  state.counters["culled_%"] = 100.0 * static_cast<double>(transport.triangles_culled) /
                               static_cast<double>(transport.triangles_culled + transport.triangles_drawn);
  state.counters["roulette_kills"] = static_cast<double>(planner.roulette_kills);
  state.counters["whole_subtrees"] = static_cast<double>(planner.whole_subtrees);
  state.counters["push_pulls"] = static_cast<double>(planner.push_pulls);
}

/// The first round of a solve, from a fresh solver; uploads and OpenGL's start not included.
void runRound(benchmark::State& state, std::int64_t workers, const solver::SolverSettings& settings) {
  const auto& [patches, materials] = patchesOf(state.range(0));
  const auto transport = makeTransport(workers, state);
  if (!transport || !transport->setScene(patches)) return;
  for (auto _ : state) {
    solver::Solver solver(patches, materials, *transport, settings);
    for (auto outcome = solver::StepOutcome::kShot; outcome == solver::StepOutcome::kShot;) {
      const auto step = solver.step();
      if (!step) return state.SkipWithError(step.error().text().c_str());
      outcome = *step;
    }
    reportRound(state, solver);
  }
}

/// Arguments: scene, workers (0: in this process).
void round(benchmark::State& state) {
  label(state);
  solver::SolverSettings settings;
  settings.target_error = 1e-3;
  runRound(state, state.range(1), settings);
}

/// What can be switched. Compare seconds x stated error^2 (the time to an equal error, where sampling is all of it).
struct Variant {
  const char* name;
  std::function<void(solver::SolverSettings&)> change;
};
const std::vector<Variant>& variants() {
  static const std::vector<Variant> all{
      {"default", [](auto&) {}},
      {"reflected light scattered, not gathered", [](auto& s) { s.planner.gather_nodes = false; }},
      {"nodes hardly ever shot whole", [](auto& s) { s.planner.variation_share = 0.25 / 16; }},
      {"four times the shooters", [](auto& s) { s.planner.shooters_a_round *= 4; }},
      {"small item buffers (N 32)", [](auto& s) { s.planner.node_resolution = 32; }},
      {"large item buffers (N 128)", [](auto& s) { s.planner.node_resolution = 128; }},
      {"residual shot to a tenth", [](auto& s) { s.target_error = 1e-4; }},
      {"weak light left (target 5 %)", [](auto& s) { s.target_error = 0.05; }},
      {"the paper to the letter", [](auto& s) { s.paper_mode = true; }},
  };
  return all;
}

/// Arguments: scene, variant.
void skip(benchmark::State& state) {
  const auto& variant = variants()[static_cast<std::size_t>(state.range(1))];
  state.SetLabel(std::string(kSceneNames[state.range(0)]) + ", " + variant.name);
  solver::SolverSettings settings;
  settings.target_error = 1e-3;
  variant.change(settings);
  runRound(state, 0, settings);
}

BENCHMARK(pushPull)
    ->ArgNames({"scene", "dirty"})
    ->ArgsProduct({{kCornell, kSmallRoom, kSeminarRoom}, {kNone, kOne, kAll}})
    ->Unit(benchmark::kMicrosecond);
BENCHMARK(receive)->ArgNames({"scene"})->DenseRange(kCornell, kSeminarRoom)->Unit(benchmark::kMicrosecond);
BENCHMARK(round)
    ->ArgNames({"scene", "workers"})
    ->ArgsProduct({{kCornell, kSmallRoom, kSeminarRoom}, workerCounts()})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);
BENCHMARK(skip)
    ->ArgNames({"scene", "variant"})
    ->ArgsProduct({{kCornell, kSmallRoom}, benchmark::CreateDenseRange(0, static_cast<int>(variants().size()) - 1, 1)})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace radiosity::benchmarks
