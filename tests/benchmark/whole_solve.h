// A whole solve as a benchmark, with what it counted. One thread.
#pragma once

#include <benchmark/benchmark.h>

#include "server/solver/solver.h"
#include "tests/benchmark/built_scenes.h"

namespace radiosity::benchmarks {

/// Stated error: reached by all built-in scenes in seconds, and small enough to be useful.
inline constexpr double kSolveGoal = 0.03;

/// Steps until the stated error asked for is reached, or cannot be. An error of `state` after a minute.
void solveToEnd(benchmark::State& state, solver::Solver& solver);

/// From a fresh solver to the stated error asked for; uploads and OpenGL's start not included. The same seed shoots the
/// same shots, so the work is the same whoever does it. 0 workers: in this process. Gives up after a minute.
void runSolve(benchmark::State& state, const Patches& scene, std::int64_t workers,
              const solver::SolverSettings& settings);

}  // namespace radiosity::benchmarks
