// LinkedSolver where reflected light comes by rays from the leaves.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "server/solver/pipeline/linked_solver.h"
#include "tests/unit/engine/failing_memory.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::kGrey;
using test::makeQuadScene;
using test::Quad;
using test::RayTransport;

struct GatheredSolve {
  explicit GatheredSolve(const std::vector<Quad>& quads, double target = 0.02,
                         std::size_t memory = std::size_t{1} << 30, std::uint32_t rays_a_shot = 256,
                         std::uint64_t seed = 1)
      : made(makeQuadScene(quads)), rays(rays_a_shot) {
    settings.target_error = target;
    settings.link_memory = memory;
    settings.seed = seed;
    EXPECT_TRUE(rays.setScene(made.patches));
    solver = make();
  }
  [[nodiscard]] std::unique_ptr<LinkedSolver> make() {
    return std::make_unique<LinkedSolver>(made.patches, made.materials, rays, settings);
  }
  /// Until it has ended, one way or the other.
  StepOutcome run() { return test::runToEnd(*solver); }
  [[nodiscard]] float darkest() const {
    float least = HUGE_VALF;
    for (const auto& light : solver->irradiance()) least = std::min({least, light.x, light.y, light.z});
    return least;
  }

  test::QuadScene made;
  RayTransport rays;
  SolverSettings settings;
  std::unique_ptr<LinkedSolver> solver;
};

// A wave may take as long as all before it.
TEST(GatheredSolver, ATargetThatIsRaisedEndsAWaveThatNobodyNeeds) {
  GatheredSolve room(cubeQuads(8, {0, 4, 0, 0, 0, 0}, kGrey), 0.001);
  room.rays.pause = std::chrono::milliseconds(5);  // so that a wave takes several slices
  auto isInWave = [&, before = std::uint64_t{0}](StepOutcome outcome) mutable {
    const auto samples = room.solver->linkCounters().samples;
    const bool grew = std::exchange(before, samples) < samples;
    return grew && outcome == StepOutcome::kSlice && room.solver->error().total < 0.02;
  };
  for (int i = 0; i < 10'000; ++i) {
    const auto outcome = room.solver->step();
    ASSERT_TRUE(outcome);
    ASSERT_NE(*outcome, StepOutcome::kConverged) << "no wave took more than a slice";
    if (isInWave(*outcome)) break;
  }
  const auto samples = room.solver->linkCounters().samples;
  room.solver->setTargetError(1.5 * room.solver->error().total);
  EXPECT_EQ(room.run(), StepOutcome::kConverged);
  EXPECT_EQ(room.solver->linkCounters().samples, samples);
}

TEST(GatheredSolver, WhereverItWasSavedTheEndIsTheSame) {
  const auto quads = cubeQuads(8, {0, 4, 0, 0, 0, 0}, kGrey);
  GatheredSolve whole(quads, 0.02), other(quads, 0.02);
  whole.run();
  int times = 0;
  for (int i = 0; i < 100'000; ++i) {
    const auto outcome = other.solver->step();
    ASSERT_TRUE(outcome);
    if (*outcome == StepOutcome::kConverged) break;
    ArchiveWriter to(std::size_t{64} << 20);
    if (!other.solver->save(to)) continue;
    auto next = other.make();
    ArchiveReader from(to.bytes());
    ASSERT_TRUE(next->restore(from));
    other.solver->assess();
    next->assess();
    ASSERT_EQ(next->error().total, other.solver->error().total) << "step " << i;
    other.solver = std::move(next);
    ++times;
  }
  EXPECT_GT(times, 3);
  EXPECT_EQ(whole.solver->irradiance(), other.solver->irradiance());
  EXPECT_EQ(whole.solver->error().total, other.solver->error().total);
}

TEST(GatheredSolver, EditsOfLightAndBackGiveTheSameBits) {
  auto quads = cubeQuads(8, {0, 4, 0, 0, 0, 0}, kGrey);
  GatheredSolve room(quads, 0.02);
  room.run();
  const auto before = room.solver->irradiance();
  quads[1].emission = glm::vec3(9.0F, 1.0F, 0.5F);
  quads[0].reflectance = glm::vec3(0.1F, 0.4F, 0.2F);
  room.solver->setMaterials(makeQuadScene(quads).materials);
  room.solver->assess();
  EXPECT_NE(room.solver->irradiance(), before);
  room.solver->setMaterials(room.made.materials);
  room.solver->assess();
  EXPECT_EQ(room.solver->irradiance(), before);
}

/// Rounds are counted over all edits; how many a solve may have begins anew with each.
TEST(GatheredSolver, ManyEditsUseUpNoRoundsOfThoseThatFollow) {
  auto quads = cubeQuads(6, {0, 4, 0, 0, 0, 0}, kGrey);
  double target = 0.02;
  GatheredSolve room(quads, target, std::size_t{1} << 30, 64);
  room.settings.max_rounds = 30;
  room.solver = room.make();
  ASSERT_EQ(room.run(), StepOutcome::kConverged);
  for (std::size_t edit = 0; edit < 40 && room.solver->rounds() <= room.settings.max_rounds; ++edit) {
    for (auto& quad : quads) quad.emission = glm::vec3(0.0F);
    quads[edit % 6].emission = glm::vec3(4.0F);
    room.solver->setTargetError(target *= 0.95);  // so that it takes rounds
    room.solver->setMaterials(makeQuadScene(quads).materials);
    ASSERT_EQ(room.run(), StepOutcome::kConverged) << "edit " << edit << ", round " << room.solver->rounds();
  }
  EXPECT_GT(room.solver->rounds(), room.settings.max_rounds);
}

TEST(GatheredSolver, ScenesWithNothingToGatherEnd) {
  for (const auto& quads : {std::vector<Quad>{}, cubeQuads(4, {}, kGrey), cubeQuads(4, {0, 4, 0, 0, 0, 0}, {}),
                            std::vector<Quad>{cubeQuads(4, {1}, kGrey)[0]}}) {
    GatheredSolve scene(quads);
    scene.run();
    EXPECT_LE(scene.solver->error().total, 0.02) << quads.size();
    EXPECT_GE(quads.empty() ? 0.0F : scene.darkest(), 0.0F);
  }
}

// Samples of links do not lower what rays leave: a round after the other of them, each with little, never ended.
TEST(GatheredSolver, WithoutMemoryForTheRaysThatTheTargetTakesEnds) {
  GatheredSolve room(cubeQuads(8, {0, 4, 0, 0, 0, 0}, kGrey), 1e-3, 2'000'000, 64);
  EXPECT_EQ(room.run(), StepOutcome::kExhausted);
  EXPECT_EQ(room.solver->limit(), SolveLimit::kLinkMemory);
  EXPECT_LT(room.solver->rounds(), 200U);
  EXPECT_LE(room.solver->linkCounters().bytes, room.settings.link_memory);
}

double sum(const LinkedSolver& solver) {
  double sum = 0.0;
  for (const auto& light : solver.irradiance()) sum += static_cast<double>(light.x);
  return sum;
}

/// One allocation fails, and the solver is asked to go on.
TEST(GatheredSolver, ThatRanOutOfMemoryOnceGoesOnToTheSameEnd) {
  const auto quads = cubeQuads(8, {0, 4, 0, 0, 0, 0}, kGrey);
  GatheredSolve whole(quads, 0.02);
  test::failAllocation(0, 64, test::Shortage::kOnce);
  whole.run();
  const auto allocations = test::letAllocate();
  int failed = 0;
  for (std::size_t number = 1; number < allocations; number += std::max<std::size_t>(1, allocations / 80)) {
    GatheredSolve short_of(quads, 0.02);
    bool ended = false, failed_now = false;
    test::failAllocation(number, 64, test::Shortage::kOnce);
    for (int i = 0; i < 10'000 && !ended; ++i) {
      const auto outcome = short_of.solver->step();
      failed_now = failed_now || !outcome;
      ended = outcome && (*outcome == StepOutcome::kConverged || *outcome == StepOutcome::kExhausted);
    }
    test::letAllocate();
    failed += failed_now ? 1 : 0;
    ASSERT_TRUE(ended) << number;
    ASSERT_LE(short_of.solver->error().total, 0.02) << number;
    ASSERT_GE(short_of.darkest(), 0.0F) << number;
    ASSERT_NEAR(sum(*short_of.solver) / sum(*whole.solver), 1.0, 0.05) << number;
  }
  EXPECT_GT(failed, 3);
}

}  // namespace
}  // namespace radiosity::solver
