// What LinkedSolver promises of nodes that are no lamps and so bright that they shoot: parts of a panel whose leaves
// shine unequally.
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>

#include "server/solver/pipeline/linked_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::RayTransport;

constexpr std::array<float, 6> kWalls{0.5F, 0.6F, 0.7F, 0.5F, 0.3F, 0.5F};

class BrightNodes : public testing::Test {
 protected:
  static constexpr std::uint32_t kPanel = 6;  // its surface
  static constexpr std::uint32_t kLeaves = 8;

  BrightNodes() : quads_(test::cubeQuads(8, test::kDark, kWalls)) {
    quads_.push_back(
        {{-0.1F, 0.3F, -0.1F}, {0.2F, 0, 0}, {0, 0, 0.2F}, kLeaves, kLeaves, glm::vec3(0.0F), glm::vec3(0.3F)});
    made_ = test::makeQuadScene(quads_);
    for (std::uint32_t leaf = 0; leaf < kLeaves * kLeaves; ++leaf)
      made_.materials.emission.set(made_.patches->surfaces[kPanel].first_node[0] + leaf,
                                   glm::vec3(leaf % 2 == 0 ? 99.0F : 101.0F));
  }

  [[nodiscard]] std::unique_ptr<LinkedSolver> make(RayTransport& rays) const {
    EXPECT_TRUE(rays.setScene(made_.patches));
    return std::make_unique<LinkedSolver>(made_.patches, made_.materials, rays, settings_);
  }
  [[nodiscard]] static std::size_t nodesOf(const LinkedSolver& solver) {
    return static_cast<std::size_t>(
        std::ranges::count_if(solver.system().shooters(), [](const Shooter& shooter) { return !shooter.isLight(); }));
  }
  /// Relative RMS difference, by area.
  [[nodiscard]] double difference(const std::vector<glm::vec3>& light, const std::vector<glm::vec3>& truth) const {
    double square = 0.0, off = 0.0;
    for (const auto& side : makeSides(*made_.patches)) {
      for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node) {
        const glm::dvec3 a(light[node]), b(truth[node]);
        square += static_cast<double>(made_.patches->node_area[node]) * glm::dot(b, b);
        off += static_cast<double>(made_.patches->node_area[node]) * glm::dot(a - b, a - b);
      }
    }
    return std::sqrt(off / square);
  }

  std::vector<test::Quad> quads_;
  test::QuadScene made_;
  SolverSettings settings_;
};

// Whoever asks for less than can be had in the time there is sees as much as somebody who asks for just that.
TEST_F(BrightNodes, ASmallErrorIsReachedByWayOfLargerOnes) {
  struct Work {
    std::uint64_t looks = 0;
    std::uint32_t resolution = 0;
  };
  const auto workTo = [&](double error, double target) {
    RayTransport rays(64);
    settings_.target_error = target;
    const auto solver = make(rays);
    Work work;
    for (int i = 0; i < 100'000; ++i) {
      work.looks = solver->linkCounters().rays + solver->shots();
      const auto outcome = solver->step();  // it may ask for those of the next round
      if (!outcome || *outcome == StepOutcome::kConverged || *outcome == StepOutcome::kExhausted) break;
      if (*outcome == StepOutcome::kRoundDone && solver->error().total <= error) break;
    }
    EXPECT_LE(solver->error().total, error);
    for (const auto& shooter : solver->system().shooters())
      work.resolution = std::max(work.resolution, shooter.resolution);
    return work;
  };
  const auto straight = workTo(0.02, 0.02), on_the_way = workTo(0.02, 1e-3);
  EXPECT_LE(on_the_way.looks, straight.looks);
  EXPECT_EQ(on_the_way.resolution, straight.resolution);
  EXPECT_GT(straight.resolution, 0U) << "nodes shoot";
}

// At a time limit the wave under way ends. The nodes that it was to measure are shooters by then: their light is not
// unshot, and goes nowhere until rays bring it.
TEST_F(BrightNodes, LightOfThoseThatAShortenedWaveDidNotMeasureIsStatedAsMissing) {
  RayTransport all(256);
  settings_.target_error = 0.01;
  const auto truth = make(all);
  test::solve(*truth);
  ASSERT_GT(nodesOf(*truth), 8U);
  bool missing = false;
  for (int steps = 1; steps < 12; ++steps) {
    RayTransport rays(256);
    rays.pause = std::chrono::milliseconds(10);  // so that a wave takes several slices
    const auto solver = make(rays);
    for (int i = 0; i < steps; ++i) ASSERT_TRUE(solver->step());
    solver->endWave();
    for (int i = 0; i < 100; ++i) {
      const auto outcome = solver->step();
      ASSERT_TRUE(outcome);
      if (*outcome != StepOutcome::kSlice) break;
    }
    solver->assess();
    const double off = difference(solver->irradiance(), truth->irradiance());
    EXPECT_LT(off, 1.5 * std::hypot(solver->error().total, 0.01)) << steps;
    missing = missing || (off > 0.1 && nodesOf(*solver) > 0);
  }
  EXPECT_TRUE(missing) << "no wave of nodes was cut short";
}

// Textures make three rows of the equation of one, whose memory is that of links.
TEST_F(BrightNodes, WhoseThreeRowsAloneWouldPassTheMemoryAreFewer) {
  RayTransport rays(64);
  settings_.target_error = 1e-6;
  settings_.link_memory = 600'000;
  const auto solver = make(rays);
  const auto run = [&] {
    for (int i = 0; i < 20'000; ++i) {
      const auto outcome = solver->step();
      if (!outcome) break;
      EXPECT_LE(solver->linkCounters().bytes, settings_.link_memory);
      if (*outcome == StepOutcome::kConverged || *outcome == StepOutcome::kExhausted) return *outcome;
    }
    return StepOutcome::kSlice;
  };
  ASSERT_EQ(run(), StepOutcome::kExhausted);
  const auto nodes = nodesOf(*solver);
  const double before = solver->error().total;
  EXPECT_GT(nodes, 8U);
  auto textured = made_.materials;
  for (std::uint32_t node = 0; node < made_.patches->nodeCount(); node += 2)
    textured.reflectance.set(node, 0.98F * textured.reflectance[node]);
  solver->setMaterials(textured);
  ASSERT_EQ(run(), StepOutcome::kExhausted);
  EXPECT_GT(nodesOf(*solver), 0U);
  EXPECT_LT(solver->error().total, 10.0 * before + 0.05) << "nearly all was thrown away";
}

}  // namespace
}  // namespace radiosity::solver
