// A whole solve, for tests.
#pragma once

#include <gtest/gtest.h>

#include <cstddef>

#include "server/scene/values/patch_scene.h"
#include "server/solver/solver.h"

namespace radiosity::test {

/// Steps until the solver has ended, one way or the other.
inline solver::StepOutcome runToEnd(solver::Solver& solver) {
  using solver::StepOutcome;
  for (int i = 0; i < 100'000; ++i) {
    const auto outcome = solver.step();
    EXPECT_TRUE(outcome) << outcome.error().text();
    if (!outcome) return StepOutcome::kExhausted;
    if (*outcome == StepOutcome::kConverged || *outcome == StepOutcome::kExhausted) return *outcome;
  }
  ADD_FAILURE() << "no end";
  return StepOutcome::kSlice;
}

/// Steps until the solver says that it has converged.
inline void solve(solver::Solver& solver) {
  for (int i = 0; i < 100000; ++i) {
    const auto outcome = solver.step();
    ASSERT_TRUE(outcome.has_value()) << outcome.error().text();
    if (*outcome == solver::StepOutcome::kConverged) return;
  }
  FAIL() << "no convergence after 100000 steps";
}

/// Of the first channel, over a surface's front.
inline double meanIrradiance(const solver::Solver& solver, const scene::PatchScene& patches, std::size_t surface) {
  const auto& of = patches.surfaces[surface];
  const auto light = solver.irradiance();
  double flux = 0.0, area = 0.0;
  for (auto node = of.first_node[0]; node < of.first_node[0] + of.width * of.height; ++node) {
    flux += static_cast<double>(patches.node_area[node] * light[node].x);
    area += static_cast<double>(patches.node_area[node]);
  }
  return flux / area;
}

}  // namespace radiosity::test
