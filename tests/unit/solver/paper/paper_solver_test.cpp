#include "server/solver/paper/paper_solver.h"

#include <gtest/gtest.h>

#include "common/archive.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

/// A closed cube whose floor shines.
class PaperCube : public testing::Test {
 protected:
  PaperCube()
      : made_(test::makeQuadScene(test::cubeQuads(8, {1.0F, 0.0F, 0.0F, 0.0F, 0.0F, 0.0F}, test::kGrey))),
        carrier_(400) {
    EXPECT_TRUE(carrier_.setScene(made_.patches));
  }
  [[nodiscard]] PaperSolver solver(double target = 0.01) {
    SolverSettings settings;
    settings.method = Method::kPaper;
    settings.target_error = target;
    return {made_.patches, made_.materials, carrier_, settings};
  }
  static StepOutcome finish(PaperSolver& solver, int most = 100'000) {
    auto outcome = StepOutcome::kSlice;
    for (int i = 0; i < most && outcome != StepOutcome::kConverged; ++i) outcome = solver.step().value();
    return outcome;
  }

  test::QuadScene made_;
  test::RayTransport carrier_;
};

TEST_F(PaperCube, EndsWhereLittleIsUnshotAndLosesNothing) {
  auto solver = this->solver();
  EXPECT_GT(solver.error().total, 1.0) << "nothing has arrived";
  ASSERT_EQ(finish(solver), StepOutcome::kConverged);
  EXPECT_LE(solver.error().total, 0.01);
  const auto energy = solver.energy();
  EXPECT_NEAR(energy.imbalance[0], 0.0, 1e-6 * energy.emitted[0]);
  EXPECT_NEAR(energy.absorbed[0] / energy.emitted[0], 1.0, 0.02) << "half is absorbed at each bounce of a closed cube";
}

TEST_F(PaperCube, IsNotDoneBeforeAnythingIsShotWhateverIsAskedFor) {
  auto solver = this->solver(1.0);
  EXPECT_EQ(solver.step().value(), StepOutcome::kShot);
}

TEST_F(PaperCube, ShootsTheSamePatchesWhoeverLooks) {
  auto watched = solver(), alone = solver();
  for (int i = 0; i < 200; ++i) {
    ASSERT_EQ(watched.step().value(), alone.step().value());
    (void)watched.energy();
    (void)watched.irradiance();
    (void)watched.unshot();
  }
  EXPECT_EQ(watched.irradiance(), alone.irradiance());
  EXPECT_EQ(watched.shotLevels(), alone.shotLevels());
}

TEST_F(PaperCube, GoesOnFromBytesWithTheSameBits) {
  auto whole = solver(), first = solver();
  for (int i = 0; i < 100; ++i) ASSERT_TRUE(first.step());
  ArchiveWriter to(1 << 24);
  ASSERT_TRUE(first.save(to));
  auto second = solver();
  ArchiveReader from(to.bytes());
  ASSERT_TRUE(second.restore(from));
  ASSERT_EQ(finish(whole), StepOutcome::kConverged);
  ASSERT_EQ(finish(second), StepOutcome::kConverged);
  EXPECT_EQ(second.irradiance(), whole.irradiance());
  EXPECT_EQ(second.shots(), whole.shots());
}

TEST_F(PaperCube, AnEditStartsFromNothing) {
  auto edited = solver();
  for (int i = 0; i < 50; ++i) ASSERT_TRUE(edited.step());
  edited.setMaterials(made_.materials);
  auto fresh = solver();
  ASSERT_EQ(finish(edited), finish(fresh));
  EXPECT_EQ(edited.irradiance(), fresh.irradiance());
}

}  // namespace
}  // namespace radiosity::solver
