#include "tests/benchmark/whole_solve.h"

#include <chrono>

#include "server/solver/pipeline/make_solver.h"

namespace radiosity::benchmarks {
namespace {

constexpr double kPatienceSeconds = 60;

double percent(double part, double whole) { return whole > 0.0 ? 100.0 * part / whole : 0.0; }

void report(benchmark::State& state, const solver::Solver& solver) {
  const auto& transport = solver.transportCounters();
  const auto& planner = solver.plannerCounters();
  const auto links = solver.linkCounters();
  const auto set = [&](const char* name, auto value) { state.counters[name] = static_cast<double>(value); };
  const double seconds = transport.render_seconds + transport.accumulate_seconds + transport.gather_seconds;
  set("shooters", planner.shooters);
  set("shots", solver.shots());
  set("stated_%", 100.0 * solver.error().total);
  set("Mpixels", 1e-6 * static_cast<double>(transport.pixels));
  set("culled_%", percent(static_cast<double>(transport.triangles_culled),
                          static_cast<double>(transport.triangles_culled + transport.triangles_drawn)));
  set("empty_faces_%", percent(static_cast<double>(transport.faces_empty), static_cast<double>(transport.faces)));
  set("render_%", percent(transport.render_seconds, seconds));
  set("roulette_kills", planner.roulette_kills);
  set("whole_subtrees", planner.whole_subtrees);
  if (links.solutions == 0) return set("push_pulls", planner.push_pulls);
  set("MiB_links", static_cast<double>(links.bytes) / 1048576.0);
  set("shots_replayed", links.replayed);
  set("rows_saved_%",
      percent(static_cast<double>(links.rows_saved), static_cast<double>(links.rows + links.rows_saved)));
}

}  // namespace

void solveToEnd(benchmark::State& state, solver::Solver& solver) {
  using solver::StepOutcome;
  const auto begin = std::chrono::steady_clock::now();
  for (auto outcome = StepOutcome::kShot; outcome != StepOutcome::kConverged && outcome != StepOutcome::kExhausted;) {
    const auto step = solver.step();
    if (!step) return state.SkipWithError(step.error().text().c_str());
    outcome = *step;
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - begin;
    if (passed.count() > kPatienceSeconds) return state.SkipWithError("did not reach the stated error in 60 s");
  }
}

void runSolve(benchmark::State& state, const Patches& scene, std::int64_t workers,
              const solver::SolverSettings& settings) {
  const auto transport = makeTransport(workers, state);
  if (!transport || !transport->setScene(scene.patches)) return;
  for (auto _ : state) {
    const auto solver = solver::makeSolver(scene.patches, scene.materials, *transport, settings);
    solveToEnd(state, *solver);
    report(state, *solver);
  }
}

}  // namespace radiosity::benchmarks
