// Furnaces: closed, the same emission E and reflectance rho everywhere, so that H = E / (1 - rho) whatever the shape.
// Near one an error of any column of links is multiplied by 1 / (1 - rho), and so is what a linear solver leaves.
#include <gtest/gtest.h>

#include <ctime>
#include <numbers>

#include "server/solver/linked_solver.h"
#include "tests/accuracy/stress/stress_solve.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

class Furnace : public testing::TestWithParam<float> {};

TEST_P(Furnace, HasItsIrradianceWithinATenthOfAPercent) {
  const float rho = GetParam();
  auto loaded = load(test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0)), 2400);
  paint(loaded, rho);
  solver::SolverSettings settings;
  settings.target_error = 0.001;
  Solve solve(loaded, settings);
  const auto begin = std::clock();
  const bool reached = solve.run();
  const double seconds = double(std::clock() - begin) / CLOCKS_PER_SEC;
  const double exact = std::numbers::pi / (1.0 - static_cast<double>(rho));
  const auto found = compareToConstant(solve, exact);
  const auto& e = solve.solver().error();
  std::printf(
      "rho %g: mean %+.3e rms %.3e stated %.3e (residual %.3e sampling %.3e) shots %llu shooters %llu, %.2f s cpu%s\n",
      double(rho), found.mean, found.rms, e.total, e.residual, e.sampling, (unsigned long long)solve.solver().shots(),
      (unsigned long long)solve.solver().plannerCounters().shooters, seconds, reached ? "" : " NOT REACHED");
  EXPECT_LT(std::abs(found.mean), 0.001);
  EXPECT_LT(found.rms, 0.001);
  expectSound(solve);
}

INSTANTIATE_TEST_SUITE_P(Reflectance, Furnace, testing::Values(0.5F, 0.9F, 0.99F, 0.999F, 0.9999F));

}  // namespace
}  // namespace radiosity::accuracy
