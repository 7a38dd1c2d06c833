// A whole solve, for tests.
#pragma once

#include <gtest/gtest.h>

#include "server/solver/solver.h"

namespace radiosity::test {

/// Steps until the solver says that it has converged.
inline void solve(solver::Solver& solver) {
  for (int i = 0; i < 100000; ++i) {
    const auto outcome = solver.step();
    ASSERT_TRUE(outcome.has_value()) << outcome.error().text();
    if (*outcome == solver::StepOutcome::kConverged) return;
  }
  FAIL() << "no convergence after 100000 steps";
}

}  // namespace radiosity::test
