// Light and colours that come back show what was there, also where more samples were needed in between.
#include "server/solver/pipeline/kept_ends.h"

#include <gtest/gtest.h>

#include <functional>

#include "server/solver/pipeline/linked_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

std::shared_ptr<KeptEnd> endOf(std::uint64_t key, std::size_t leaves) {
  auto end = std::make_shared<KeptEnd>();
  end->key = key;
  end->half[0].resize(leaves);
  return end;
}

TEST(KeptEnds, TheOldestGoFirst) {
  KeptEnds ends(3 * endOf(1, 1000)->bytes());
  for (const std::uint64_t key : {1, 2, 3}) ends.keep(endOf(key, 1000));
  EXPECT_TRUE(ends.find(1));  // asked for after the others came
  ends.keep(endOf(4, 1000));
  EXPECT_FALSE(ends.find(2));
  for (const std::uint64_t key : {1, 3, 4}) EXPECT_TRUE(ends.find(key)) << key;
  EXPECT_LE(ends.bytes(), 3 * endOf(1, 1000)->bytes());
}

TEST(KeptEnds, OneTakesThePlaceOfAnotherWithItsKeyAndTheTooLargeNone) {
  KeptEnds ends(endOf(1, 1000)->bytes());
  ends.keep(endOf(1, 1000));
  ends.keep(endOf(1, 500));
  EXPECT_EQ(ends.find(1)->half[0].size(), 500U);
  EXPECT_EQ(ends.bytes(), endOf(1, 500)->bytes());
  ends.keep(endOf(2, 2000));
  EXPECT_FALSE(ends.find(2));
  EXPECT_TRUE(ends.find(1));
}

class KeptEndsOfASolve : public testing::Test {
 protected:
  KeptEndsOfASolve() : quads_(test::cubeQuads(8, {0, 4, 0, 0, 0, 0}, test::kGrey)) {
    made_ = test::makeQuadScene(quads_);
    EXPECT_TRUE(transport_.setScene(made_.patches));
    solver_ = make();
    test::solve(*solver_);
  }
  [[nodiscard]] std::unique_ptr<LinkedSolver> make() {
    return std::make_unique<LinkedSolver>(made_.patches, made_.materials, transport_, settings_);
  }
  void edit(const std::function<void(std::vector<test::Quad>&)>& change) {
    auto quads = quads_;
    change(quads);
    solver_->setMaterials(test::makeQuadScene(quads).materials);
    test::solve(*solver_);
  }

  std::vector<test::Quad> quads_;
  test::QuadScene made_;
  SolverSettings settings_;
  test::RayTransport transport_{256};
  std::unique_ptr<LinkedSolver> solver_;
};

TEST_F(KeptEndsOfASolve, EditsThatNeedMoreSamplesAndBackGiveTheSameBits) {
  const auto before = solver_->irradiance(), half = solver_->halfIrradiance(0);
  const double error = solver_->error().total;
  const auto common = solver_->commonErrorSquared();
  ASSERT_FALSE(common.empty());
  const auto samples = [&] { return solver_->linkCounters().rays + solver_->linkCounters().samples; };
  std::size_t needed_more = 0;
  const std::vector<std::function<void(std::vector<test::Quad>&)>> changes{
      [](auto& quads) { quads[1].emission = glm::vec3(0.0F); },
      [](auto& quads) { quads[1].emission = glm::vec3(9.0F, 0.1F, 0.5F); },
      [](auto& quads) { quads[3].emission = glm::vec3(40.0F), quads[1].emission = glm::vec3(0.0F); },
      [](auto& quads) { quads[0].emission = glm::vec3(0.02F), quads[1].emission = glm::vec3(0.0F); },
      [](auto& quads) {
        for (auto& quad : quads) quad.reflectance = glm::vec3(0.95F, 0.1F, 0.5F);
      },
  };
  for (std::size_t i = 0; i < changes.size(); ++i) {
    const auto there = samples();
    edit(changes[i]);
    if (samples() > there) ++needed_more;
    EXPECT_NE(solver_->irradiance(), before) << i;
    EXPECT_NE(solver_->commonErrorSquared(), common) << i;
    edit([](auto&) {});
    EXPECT_EQ(solver_->commonErrorSquared(), common) << i;
    EXPECT_EQ(solver_->irradiance(), before) << i;
    EXPECT_EQ(solver_->halfIrradiance(0), half) << i;
    EXPECT_EQ(solver_->error().total, error) << i;
    solver_->assess();
    EXPECT_EQ(solver_->error().total, error) << i;
  }
  EXPECT_GT(needed_more, 1U);
}

TEST_F(KeptEndsOfASolve, ASmallerErrorThanThatEndHadIsWorkedFor) {
  const auto before = solver_->irradiance();
  edit([](auto& quads) { quads[1].emission = glm::vec3(9.0F, 0.1F, 0.5F); });
  solver_->setTargetError(0.2 * solver_->error().total);
  test::solve(*solver_);
  edit([](auto&) {});
  EXPECT_NE(solver_->irradiance(), before);
  const auto finer = solver_->irradiance();
  EXPECT_LE(solver_->error().total, 0.005);
  edit([](auto& quads) { quads[1].emission = glm::vec3(0.0F); });
  edit([](auto&) {});
  EXPECT_EQ(solver_->irradiance(), finer);
}

TEST_F(KeptEndsOfASolve, ASmallerErrorThanThatShownIsWorkedForWithWhatCameInBetween) {
  edit([](auto& quads) { quads[3].emission = glm::vec3(40.0F), quads[1].emission = glm::vec3(0.0F); });
  edit([](auto&) {});  // shown again; the links and rays that there are know it better
  const double target = 0.3 * solver_->error().total;
  solver_->setTargetError(target);
  test::solve(*solver_);
  EXPECT_LE(solver_->error().total, target);
  EXPECT_EQ(solver_->limit(), SolveLimit::kNone);
}

TEST_F(KeptEndsOfASolve, AShownEndIsStillShownAfterItWasSaved) {
  const auto before = solver_->irradiance();
  edit([](auto& quads) { quads[3].emission = glm::vec3(40.0F), quads[1].emission = glm::vec3(0.0F); });
  edit([](auto&) {});
  ASSERT_EQ(solver_->irradiance(), before);
  ArchiveWriter to(std::size_t{64} << 20U);
  ASSERT_TRUE(solver_->save(to));
  const auto next = make();
  ArchiveReader from(to.bytes());
  ASSERT_TRUE(next->restore(from));
  EXPECT_EQ(next->irradiance(), before);
  test::solve(*next);
  EXPECT_EQ(next->irradiance(), before);
}

}  // namespace
}  // namespace radiosity::solver
