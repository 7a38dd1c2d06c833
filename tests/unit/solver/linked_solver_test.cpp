// What only the solver that remembers its links promises.
#include "server/solver/linked_solver.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;
using test::RayTransport;
using test::solve;

class LinkedEdits : public testing::Test {
 protected:
  LinkedEdits() : quads_(cubeQuads(4, {0, 4, 0, 0, 0, 0}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F})) {}
  void SetUp() override {
    made_ = makeQuadScene(quads_);
    ASSERT_TRUE(rays_.setScene(made_.patches));
    solver_ = std::make_unique<LinkedSolver>(made_.patches, made_.materials, rays_, SolverSettings{});
    solve(*solver_);
  }

  std::vector<test::Quad> quads_;
  test::QuadScene made_;
  RayTransport rays_{64};
  std::unique_ptr<LinkedSolver> solver_;
};

TEST_F(LinkedEdits, OfTheLampAndBackGiveTheSameBits) {
  const auto before = solver_->irradiance();
  const auto shots = solver_->shots();
  quads_[1].emission = glm::vec3(9.0F, 1.0F, 0.5F);
  solver_->setMaterials(makeQuadScene(quads_).materials);
  solve(*solver_);
  EXPECT_NE(solver_->irradiance(), before);
  solver_->setMaterials(made_.materials);
  solve(*solver_);
  EXPECT_EQ(solver_->shots(), shots);
  EXPECT_EQ(solver_->irradiance(), before);
}

TEST_F(LinkedEdits, OfReflectanceAgreeWithAFreshSolveWithinTheTwoStatedErrors) {
  quads_[3].reflectance = glm::vec3(0.8F, 0.2F, 0.1F);
  const auto painted = makeQuadScene(quads_);
  solver_->setMaterials(painted.materials);
  solve(*solver_);
  SolverSettings other;
  other.seed = 2;
  LinkedSolver fresh(painted.patches, painted.materials, rays_, other);
  solve(fresh);
  // A stated error is itself an estimate: the product promises the truth within a factor of 1.5.
  constexpr double kCalibration = 1.5;
  double square = 0.0, difference = 0.0;
  for (std::size_t node = 0; node < fresh.irradiance().size(); ++node) {
    const glm::vec3 a = solver_->irradiance()[node], b = fresh.irradiance()[node];
    for (int c = 0; c < 3; ++c) {
      square += static_cast<double>(b[c] * b[c]);
      difference += static_cast<double>((a[c] - b[c]) * (a[c] - b[c]));
    }
  }
  EXPECT_LT(std::sqrt(difference / square), kCalibration * std::hypot(solver_->error().total, fresh.error().total));
}

TEST_F(LinkedEdits, AThousandRandomOnesLeaveNoDriftAndNoMemory) {
  const auto before = solver_->irradiance();
  const auto bytes = solver_->system().bytes();
  std::uint32_t random = 1;
  for (int i = 0; i < 1000; ++i) {
    random = random * 1664525U + 1013904223U;
    auto edited = quads_;
    edited[1].emission = glm::vec3(static_cast<float>(random >> 24U) + 5.0F);
    solver_->setMaterials(makeQuadScene(edited).materials);
    solver_->assess();
    ASSERT_NE(solver_->irradiance(), before);
  }
  solver_->setMaterials(made_.materials);
  solver_->assess();
  EXPECT_EQ(solver_->irradiance(), before);
  EXPECT_EQ(solver_->system().bytes(), bytes);
}

TEST_F(LinkedEdits, ADimmedLampDimsIndirectLightWithIt) {
  const auto before = solver_->irradiance();
  quads_[1].emission = glm::vec3(4.0F / 1024.0F);
  solver_->setMaterials(makeQuadScene(quads_).materials);
  solve(*solver_);
  const auto node = made_.patches->surfaces[1].first_node[0];  // the lamp's own wall sees indirect light only
  EXPECT_NEAR(solver_->irradiance()[node].x * 1024.0F / before[node].x, 1.0F, 1e-3F);
}

LightSources lamp(const glm::dvec3& at, float candela) {
  return {{{.position = at, .intensity = glm::vec3(candela)}}, {}};
}

TEST_F(LinkedEdits, WhileALampIsHalfMeasuredLoseNoHalf) {
  LinkedSolver solver(made_.patches, made_.materials, rays_, SolverSettings{}, lamp({0.1, 0.2, 0.0}, 5.0F));
  ASSERT_TRUE(solver.step());
  ASSERT_TRUE(solver.step());
  solver.setLights(lamp({0.1, 0.2, 0.0}, 10.0F));
  solve(solver);
  LinkedSolver fresh(made_.patches, made_.materials, rays_, SolverSettings{}, lamp({0.1, 0.2, 0.0}, 10.0F));
  solve(fresh);
  const auto node = made_.patches->surfaces[0].first_node[0] + 5;
  EXPECT_NEAR(solver.irradiance()[node].x / fresh.irradiance()[node].x, 1.0F, 0.06F);
}

TEST_F(LinkedEdits, ALampTooWeakForTheTargetIsMeasuredWhenTheTargetFalls) {
  SolverSettings settings;
  settings.target_error = 0.1;
  LinkedSolver solver(made_.patches, made_.materials, rays_, settings);
  solve(solver);
  solver.setLights(lamp({0.1, 0.2, 0.0}, 0.003F));
  solve(solver);
  solver.setTargetError(0.02);
  solve(solver);
  EXPECT_EQ(std::count_if(solver.system().shooters().begin(), solver.system().shooters().end(),
                          [](const Shooter& shooter) { return shooter.owes(); }),
            0);
}

TEST_F(LinkedEdits, ALampDraggedAboutLeavesNoTrail) {
  std::size_t shooters = 0;
  for (int i = 0; i < 200; ++i) {
    solver_->setLights(lamp({0.002 * i - 0.2, 0.1, 0.0}, 3.0F));
    ASSERT_TRUE(solver_->step());
    if (i == 20) shooters = solver_->system().shooters().size();
  }
  EXPECT_LE(solver_->system().shooters().size(), shooters);
  solve(*solver_);
  LinkedSolver fresh(made_.patches, made_.materials, rays_, SolverSettings{},
                     lamp({0.002 * 199 - 0.2, 0.1, 0.0}, 3.0F));
  solve(fresh);
  const auto node = made_.patches->surfaces[0].first_node[0] + 5;
  EXPECT_NEAR(solver_->irradiance()[node].x / fresh.irradiance()[node].x, 1.0F, 0.06F);
}

TEST(LinkedSolver, ATinyLightIsNotBlack) {
  auto quads = cubeQuads(4, {}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F});
  quads.push_back({{0, 0.4F, 0}, {1e-6F, 0, 0}, {0, 0, 1e-6F}, 1, 1, glm::vec3(1e12F), glm::vec3(0.0F)});
  const auto made = makeQuadScene(quads);
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  LinkedSolver solver(made.patches, made.materials, rays, SolverSettings{});
  solve(solver);
  const auto energy = solver.energy();
  EXPECT_NEAR(energy.absorbed[0] / energy.emitted[0], 1.0, 0.05);
}

TEST(LinkMemory, WhenItIsUsedUpTheSolveGoesOnWithTheShootersThereAre) {
  const auto made = makeQuadScene(cubeQuads(8, {0, 4, 0, 0, 0, 0}, {0.5F, 0.6F, 0.7F, 0.5F, 0.3F, 0.5F}));
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  SolverSettings settings;
  settings.target_error = 1e-6;
  settings.link_memory = 40'000;
  LinkedSolver solver(made.patches, made.materials, rays, settings);
  std::size_t most = 0;
  for (int i = 0; i < 400; ++i) {
    ASSERT_TRUE(solver.step());
    most = std::max(most, solver.system().bytes());
  }
  // One wave may pass the bound; none follows.
  EXPECT_LT(most, 4 * settings.link_memory);
  EXPECT_GT(solver.irradiance()[made.patches->surfaces[0].first_node[0]].x, 0.0F);
}

}  // namespace
}  // namespace radiosity::solver
