// The error of single texels against the stated one, and against what many seeds do.
#include "server/solver/error/texel_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>

#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/shooting/shooting_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;
using test::RayTransport;
using test::solve;

constexpr double kCoarse = 0.06;

struct TexelError : testing::Test {
  TexelError() {
    auto quads = cubeQuads(8, {0, 0, 0, 0, 0, 0}, {0.5F, 0.8F, 0.5F, 0.2F, 0.5F, 0.5F});
    quads.push_back(
        {{-0.1F, 0.4F, -0.1F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.0F, 0.2F}, 2, 2, glm::vec3(20.0F, 10.0F, 5.0F)});
    made = makeQuadScene(quads);
    EXPECT_TRUE(rays.setScene(made.patches));
  }

  [[nodiscard]] std::vector<glm::vec3> squared(const Solver& solver, const ErrorParts& stated) const {
    return texelErrorSquared(*made.patches, solver.halfIrradiance(0), solver.halfIrradiance(1), solver.irradiance(),
                             stated, solver.commonErrorSquared());
  }
  /// Area-weighted sum over leaves and channels.
  template <typename ValueOf>
  [[nodiscard]] double weighted(const ValueOf& value_of) const {
    double sum = 0.0;
    for (const auto& side : makeSides(*made.patches)) {
      for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node)
        sum += static_cast<double>(made.patches->node_area[node]) * value_of(node);
    }
    return sum;
  }
  static double sumOf(const glm::vec3& v) {
    return static_cast<double>(v.x) + static_cast<double>(v.y) + static_cast<double>(v.z);
  }

  test::QuadScene made;
  RayTransport rays{48};
};

TEST_F(TexelError, ItsAreaWeightedRmsIsTheStatedError) {
  SolverSettings settings;
  settings.target_error = kCoarse;
  LinkedSolver linked(made.patches, made.materials, rays, settings);
  ShootingSolver shooting(made.patches, made.materials, rays, settings);
  for (Solver* solver : std::initializer_list<Solver*>{&linked, &shooting}) {
    solve(*solver);
    const auto error = squared(*solver, solver->error());
    const auto& h = solver->irradiance();
    const double square = weighted([&](std::uint32_t n) { return static_cast<double>(glm::dot(h[n], h[n])); });
    const double found = std::sqrt(weighted([&](std::uint32_t n) { return sumOf(error[n]); }) / square);
    EXPECT_NEAR(found / solver->error().total, 1.0, 1e-4);  // single precision; nothing is lost at the sides' edges
    for (const auto& value : error) EXPECT_GE(std::min({value.x, value.y, value.z}), 0.0F);
  }
}

// Solves of many seeds scatter around their mean as much as each says of itself: over all texels, and over the quarters
// that say most and least. Without what all seeds are off by alike: light that they leave out, and what smoothing
// takes.
TEST_F(TexelError, IsTheScatterOfManySeeds) {
  constexpr int kSeeds = 48;
  const auto nodes = made.patches->nodeCount();
  std::vector<glm::dvec3> sum(nodes), square(nodes), said(nodes);
  for (int seed = 1; seed <= kSeeds; ++seed) {
    SolverSettings settings;
    settings.target_error = kCoarse;
    settings.seed = static_cast<std::uint64_t>(seed);
    LinkedSolver solver(made.patches, made.materials, rays, settings);
    solve(solver);
    auto sampling = solver.error();
    sampling.residual = 0.0;
    const auto error = squared(solver, sampling), common = solver.commonErrorSquared();
    const auto light = solver.irradiance();
    ASSERT_EQ(common.size(), nodes);
    for (std::size_t n = 0; n < nodes; ++n) {
      const glm::dvec3 h(light[n]);
      sum[n] += h;
      square[n] += h * h;
      said[n] += glm::dvec3(error[n] - common[n]) / static_cast<double>(kSeeds);
    }
  }
  const auto scatter = [&](std::uint32_t n) {  // unbiased variance
    const glm::dvec3 mean = sum[n] / static_cast<double>(kSeeds);
    const glm::dvec3 v = (square[n] / static_cast<double>(kSeeds) - mean * mean) * (kSeeds / (kSeeds - 1.0));
    return v.x + v.y + v.z;
  };
  const auto stated = [&](std::uint32_t n) { return said[n].x + said[n].y + said[n].z; };
  std::vector<double> levels;
  for (const auto& side : makeSides(*made.patches))
    for (auto n = side.first_node; n < side.first_node + side.leaf_count; ++n)
      if (made.patches->node_area[n] > 0.0F) levels.push_back(stated(n));
  std::sort(levels.begin(), levels.end());
  const double low = levels[levels.size() / 4], high = levels[3 * levels.size() / 4];
  const auto ratio = [&](double from, double to) {
    const auto within = [&](std::uint32_t n) { return stated(n) >= from && stated(n) <= to; };
    return std::sqrt(weighted([&](std::uint32_t n) { return within(n) ? stated(n) : 0.0; }) /
                     weighted([&](std::uint32_t n) { return within(n) ? scatter(n) : 0.0; }));
  };
  RecordProperty("all", std::to_string(ratio(0.0, levels.back())));
  RecordProperty("lowest_quarter", std::to_string(ratio(0.0, low)));
  RecordProperty("highest_quarter", std::to_string(ratio(high, levels.back())));
  // Measured: 1.11, 0.97 and 1.09. What 48 seeds scatter is itself known to about a tenth, and less well over a quarter
  // of the texels, whose errors go together.
  EXPECT_NEAR(ratio(0.0, levels.back()), 1.0, 0.25);
  EXPECT_NEAR(ratio(0.0, low), 1.0, 0.5);
  EXPECT_NEAR(ratio(high, levels.back()), 1.0, 0.35);
}

}  // namespace
}  // namespace radiosity::solver
