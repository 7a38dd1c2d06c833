// The solver: push-pull, whole solves by number of workers, and what its shortcuts save.
#include <benchmark/benchmark.h>

#include <chrono>
#include <functional>
#include <random>
#include <string>

#include "server/solver/solver.h"
#include "server/solver/state.h"
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

void reportSolve(benchmark::State& state, const solver::Solver& solver) {
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

constexpr double kGoal = 0.03;  // stated error: reached by all scenes in seconds, and small enough to be useful
constexpr double kPatienceSeconds = 60;  // of one solve

/// From a fresh solver to the stated error asked for; uploads and OpenGL's start not included. The same seed shoots the
/// same shots, so the work is the same whoever does it.
void runSolve(benchmark::State& state, std::int64_t workers, const solver::SolverSettings& settings) {
  using solver::StepOutcome;
  const auto& [patches, materials] = patchesOf(state.range(0));
  const auto transport = makeTransport(workers, state);
  if (!transport || !transport->setScene(patches)) return;
  for (auto _ : state) {
    const auto begin = std::chrono::steady_clock::now();
    const auto solver = solver::makeSolver(patches, materials, *transport, settings);
    for (auto outcome = StepOutcome::kShot; outcome != StepOutcome::kConverged && outcome != StepOutcome::kExhausted;) {
      const auto step = solver->step();
      if (!step) return state.SkipWithError(step.error().text().c_str());
      outcome = *step;
      const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
      if (passed.count() > kPatienceSeconds) return state.SkipWithError("did not reach the stated error in 60 s");
    }
    reportSolve(state, *solver);
  }
}

/// Arguments: scene, workers (0: in this process).
void solve(benchmark::State& state) {
  label(state);
  solver::SolverSettings settings;
  settings.target_error = kGoal;
  runSolve(state, state.range(1), settings);
}

/// What can be switched; the counters say what it changed.
struct Variant {
  const char* name;
  std::function<void(solver::SolverSettings&)> change;
};
const std::vector<Variant>& variants() {
  static const std::vector<Variant> kAll{
      {"default", [](auto&) {}},
      {"small item buffers (N 32)", [](auto& s) { s.planner.node_resolution = 32; }},
      {"large item buffers (N 128)", [](auto& s) { s.planner.node_resolution = 128; }},
      {"four times the first shooters", [](auto& s) { s.planner.shooters_a_round *= 4; }},
      {"links forgotten", [](auto& s) { s.link_memory = 0; }},
      {"links forgotten, reflected light scattered",
       [](auto& s) { s.link_memory = 0, s.planner.gather_nodes = false; }},
      {"links forgotten, nodes hardly ever shot whole",
       [](auto& s) { s.link_memory = 0, s.planner.variation_share /= 16; }},
      {"the paper to the letter", [](auto& s) { s.paper_mode = true; }},
  };
  return kAll;
}

/// Arguments: scene, variant. With the paper's way the goal is for what is unshot, and its sampling error stays.
void skip(benchmark::State& state) {
  const auto& variant = variants()[static_cast<std::size_t>(state.range(1))];
  state.SetLabel(std::string(kSceneNames[state.range(0)]) + ", " + variant.name);
  solver::SolverSettings settings;
  settings.target_error = kGoal;
  variant.change(settings);
  runSolve(state, 0, settings);
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
BENCHMARK(skip)
    ->ArgNames({"scene", "variant"})
    ->ArgsProduct({{kCornell, kSmallRoom}, benchmark::CreateDenseRange(0, static_cast<int>(variants().size()) - 1, 1)})
    ->MeasureProcessCPUTime()
    ->UseRealTime()
    ->Unit(benchmark::kMillisecond);

}  // namespace
}  // namespace radiosity::benchmarks
