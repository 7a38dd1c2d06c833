// Verdicts on planes whose light is known.
#include "server/solver/planes/plane_figures.h"

#include <gtest/gtest.h>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

// From tables of Student's distribution, one-sided.
TEST(StudentQuantile, IsThatOfTables) {
  EXPECT_NEAR(studentQuantile(0.95, 1.0), 6.314, 1e-3);
  EXPECT_NEAR(studentQuantile(0.95, 15.0), 1.753, 1e-3);
  EXPECT_NEAR(studentQuantile(0.975, 15.0), 2.131, 1e-3);
  EXPECT_NEAR(studentQuantile(0.975, 7.0), 2.365, 1e-3);
  EXPECT_NEAR(studentQuantile(0.95, 1e6), 1.645, 1e-3);
}

/// A plane near a floor that sends 40 lm/m^2 on one half and, on the other, `other`.
class Verdicts : public testing::Test {
 protected:
  [[nodiscard]] PlaneResult judged(const PlaneGoal& goal, double systematic = 0.0, float difference = 0.0F,
                                   float other = 40.0F) {
    test::Quad floor{{-0.5F, -0.4F, 0.5F}, {1.0F, 0.0F, 0.0F}, {0.0F, 0.0F, -1.0F}};
    floor.width = floor.height = 16;
    floor.reflectance = glm::vec3(0.5F);
    const auto scene = test::makeQuadScene({floor});
    std::vector<glm::vec3> irradiance(scene.patches->nodeCount(), glm::vec3(0.0F));
    for (std::uint32_t leaf = 0; leaf < 256; ++leaf)
      irradiance[leaf] = glm::vec3(2.0F * (leaf % 16 < 8 ? 40.0F : other));
    const std::vector<glm::vec3> halves(scene.patches->nodeCount(), glm::vec3(difference));
    const LightSources dark;
    const PlaceLight light({*scene.patches, nullptr, nullptr, scene.materials, dark, irradiance, halves});
    const PlaneGrid grid{{-0.25, -0.3999, -0.1}, {0.5, 0.0, 0.0}, {0.0, 0.0, 0.2}, {0.0, -1.0, 0.0}, 2, 2};
    PlaneRays rays(light, grid, 1);
    rays.measure(0.01);
    return planeFigures(rays, systematic, goal);
  }
};

TEST_F(Verdicts, AreNoneWhereNothingIsAskedFor) {
  const auto verdict = judged({}).verdict;
  EXPECT_FALSE(verdict.lux || verdict.uniformity || verdict.all);
}

TEST_F(Verdicts, OnTheMeanKnowThreeAnswers) {
  EXPECT_EQ(judged({39.0, {}}).verdict.lux, Verdict::kPasses);
  EXPECT_EQ(judged({41.0, {}}).verdict.lux, Verdict::kFails);
  EXPECT_EQ(judged({39.0, {}}, 0.0, 4.0F).verdict.lux, Verdict::kUndecided) << "the halves make it 40 +- 1";
  EXPECT_EQ(judged({35.0, {}}, 0.0, 4.0F).verdict.lux, Verdict::kUndecided) << "two halves: 6.3 times that";
  EXPECT_EQ(judged({32.0, {}}, 0.0, 4.0F).verdict.lux, Verdict::kPasses);
  EXPECT_EQ(judged({48.0, {}}, 0.0, 4.0F).verdict.lux, Verdict::kFails);
  EXPECT_EQ(judged({39.0, {}}, 0.05).verdict.lux, Verdict::kUndecided) << "the solve may be off by 2";
  EXPECT_EQ(judged({30.0, {}}, 0.05).verdict.lux, Verdict::kPasses);
  EXPECT_EQ(judged({50.0, {}}, 0.05).verdict.lux, Verdict::kFails);
}

TEST_F(Verdicts, OnUniformityKnowThreeAnswers) {
  EXPECT_EQ(judged({{}, 0.9}).verdict.uniformity, Verdict::kPasses);
  // 40 and 10 lux: the mean is 25, U0 0.4.
  EXPECT_NEAR(judged({{}, 0.3}, 0.0, 0.0F, 10.0F).figures.uniformity, 0.4, 0.005);
  EXPECT_EQ(judged({{}, 0.35}, 0.0, 0.0F, 10.0F).verdict.uniformity, Verdict::kPasses);
  EXPECT_EQ(judged({{}, 0.45}, 0.0, 0.0F, 10.0F).verdict.uniformity, Verdict::kFails);
  // What the solve may be off by counts at the point and in the mean: 0.05 of 40 lux, and 1.9 times that.
  EXPECT_EQ(judged({{}, 0.97}, 0.05).verdict.uniformity, Verdict::kUndecided);
  EXPECT_EQ(judged({{}, 0.8}, 0.05).verdict.uniformity, Verdict::kPasses);
  EXPECT_EQ(judged({{}, 0.45}, 0.05, 0.0F, 10.0F).verdict.uniformity, Verdict::kUndecided);
  EXPECT_EQ(judged({{}, 0.6}, 0.05, 0.0F, 10.0F).verdict.uniformity, Verdict::kFails);
  EXPECT_EQ(judged({{}, 0.4}, 0.0, 2.0F, 10.0F).verdict.uniformity, Verdict::kUndecided);
}

TEST_F(Verdicts, AllPassWhereBothDoAndFailWhereOneDoes) {
  EXPECT_EQ(judged({39.0, 0.9}).verdict.all, Verdict::kPasses);
  EXPECT_EQ(judged({41.0, 0.9}).verdict.all, Verdict::kFails);
  EXPECT_EQ(judged({24.0, 0.45}, 0.0, 0.0F, 10.0F).verdict.all, Verdict::kFails);
  EXPECT_EQ(judged({39.0, 0.9}, 0.05).verdict.all, Verdict::kUndecided);
}

TEST_F(Verdicts, OnASolveOfUnknownErrorAreUndecided) {
  EXPECT_EQ(judged({1.0, 0.1}, 0.11).verdict.all, Verdict::kUndecided) << "a tenth of the light may be missing";
  EXPECT_EQ(judged({1.0, 0.1}, 1.0).verdict.all, Verdict::kUndecided);
  EXPECT_EQ(judged({1000.0, 0.1}, 1.0).verdict.all, Verdict::kUndecided);
}

}  // namespace
}  // namespace radiosity::solver
