// LinkedSolver where reflected light comes by rays, and lamps so small that few rays or none find them.
#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <tuple>

#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/pipeline/make_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::kGrey;
using test::makeQuadScene;
using test::Quad;
using test::RayTransport;

constexpr double kTarget = 0.02;

/// A closed grey cube and in it a lamp of the given width that is no polygon (`planar` is false, as of a bulb).
struct LampRoom {
  explicit LampRoom(float width, float emission, float ceiling = 0.0F) : quads(cubeQuads(8, {0, ceiling}, kGrey)) {
    quads.push_back({{0.03F - width / 2, 0.02F, 0.01F - width / 2},
                     {width, 0, 0},
                     {0, 0, width},
                     2,
                     2,
                     glm::vec3(emission),
                     glm::vec3(0.5F)});
  }

  /// A pane in the middle of the room, opaque as it is, makes all of it one that can be seen through.
  void addPane() { quads.push_back({{-0.2F, -0.1F, -0.2F}, {0, 0, 0.1F}, {0.1F, 0, 0}, 2, 2, {}, glm::vec3(0.5F)}); }

  test::QuadScene make(bool lamp_is_sheet = false) const {
    auto made = makeQuadScene(quads);
    made.patches->surfaces[6].planar = false;
    const auto makeSheet = [&](scene::Surface& surface) {
      surface.see_through = true;
      surface.first_opacity = 0;
      surface.opacity_scale = 1;
      made.patches->opacity.assign(4, 255);
    };
    if (quads.size() > 7) makeSheet(made.patches->surfaces[7]);
    if (lamp_is_sheet) makeSheet(made.patches->surfaces[6]);
    return made;
  }

  std::vector<Quad> quads;
};

struct LampSolve {
  explicit LampSolve(test::QuadScene scene, std::uint64_t seed, double target = kTarget) : made(std::move(scene)) {
    settings.target_error = target;
    settings.seed = seed;
    EXPECT_TRUE(rays.setScene(made.patches));
    solver = std::make_unique<LinkedSolver>(made.patches, made.materials, rays, settings);
    outcome = run();
  }
  StepOutcome run() { return test::runToEnd(*solver); }
  /// One channel, of all leaves.
  [[nodiscard]] double received() const {
    double flux = 0.0;
    const auto light = solver->irradiance();
    for (const auto& side : makeSides(*made.patches)) {
      for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node)
        flux += static_cast<double>(made.patches->node_area[node] * light[node].x);
    }
    return flux;
  }
  /// Relative RMS over leaves.
  [[nodiscard]] double awayFrom(const LampSolve& other) const {
    double square = 0.0, difference = 0.0;
    const auto here = solver->irradiance(), there = other.solver->irradiance();
    for (const auto& side : makeSides(*made.patches)) {
      for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node) {
        const glm::dvec3 a(here[node]), b(there[node]);
        const auto area = static_cast<double>(made.patches->node_area[node]);
        square += area * glm::dot(b, b);
        difference += area * glm::dot(a - b, a - b);
      }
    }
    return std::sqrt(difference / square);
  }

  test::QuadScene made;
  RayTransport rays{256};
  SolverSettings settings;
  std::unique_ptr<LinkedSolver> solver;
  StepOutcome outcome = StepOutcome::kSlice;
};

TEST(MissedLamp, InASceneThatOneCanSeeThroughAllItsLightArrives) {
  for (const float width : {0.003F, 0.01F, 0.1F}) {
    const float emission = 1.0F / (width * width);
    LampRoom room(width, emission);
    room.addPane();
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      const LampSolve solve(room.make(), seed);
      EXPECT_EQ(solve.outcome, StepOutcome::kConverged) << width;
      // Nothing leaves, and half of what arrives is kept: 1 / (1 - 1/2).
      EXPECT_NEAR(solve.received(), 2.0, 2.0 * kTarget) << width << ", seed " << seed;
    }
  }
}

// In a bright room all bounces of what is missed are missing, too; and once there are no more rays to be had samples of
// the ceiling find it no better.
TEST(MissedLamp, ThatIsASheetInABrightRoomIsNoSolveThatIsDone) {
  for (const auto& [reflectance, ratio, target] :
       {std::tuple{0.97F, 3.5F, 0.12}, {0.9F, 4.0F, 0.3}, {0.85F, 3.5F, 0.1}}) {
    const float width = 0.002F;
    LampRoom room(width, ratio / (width * width), 1.0F);
    for (std::size_t face = 0; face < 6; ++face) room.quads[face].reflectance = glm::vec3(reflectance);
    room.addPane();
    const double all = (1.0 + static_cast<double>(ratio)) / (1.0 - static_cast<double>(reflectance));
    const LampSolve solve(room.make(true), 1, target);
    const double truth = std::abs(solve.received() / all - 1.0);
    // The lamp's own two leaves and the pane, of reflectance 0.5, take up to a tenth of it.
    EXPECT_LT(truth, 1.5 * solve.solver->error().total + 0.1) << reflectance;
    EXPECT_LT(solve.solver->rounds(), 40U) << reflectance;
    if (solve.outcome == StepOutcome::kExhausted) {
      EXPECT_EQ(solve.solver->limit(), SolveLimit::kRays) << reflectance;
    }
  }
}

// What shines and can be seen through is left to rays. Those that miss it know at least that light is missing.
TEST(MissedLamp, ThatIsASheetIsNoSolveThatIsDone) {
  for (const float ceiling : {0.0F, 1.0F}) {
    const float width = 0.003F;
    LampRoom room(width, 0.5F / (width * width), ceiling);
    room.addPane();
    const double all = 2.0 * (0.5 + static_cast<double>(ceiling));
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      const LampSolve solve(room.make(true), seed, 0.1);
      const double truth = std::abs(solve.received() / all - 1.0);
      EXPECT_LT(truth, 1.5 * std::hypot(solve.solver->error().total, 0.02)) << ceiling << ", seed " << seed;
      if (solve.solver->error().total > 0.1) {
        EXPECT_EQ(solve.outcome, StepOutcome::kExhausted) << ceiling << ", seed " << seed;
      }
    }
  }
}

TEST(MissedLamp, ThatIsSwitchedOnComesOverLinksAsInAFreshSolve) {
  for (const float width : {0.003F, 0.03F}) {
    const LampRoom off(width, 0.0F, 1.0F), on(width, 0.2F / (width * width), 1.0F);
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      LampSolve edited(off.make(), seed);
      const auto before = edited.solver->irradiance();
      edited.solver->setMaterials(on.make().materials);
      EXPECT_EQ(edited.run(), StepOutcome::kConverged);
      const LampSolve fresh(on.make(), seed);
      EXPECT_EQ(fresh.outcome, StepOutcome::kConverged);
      const double stated = std::hypot(edited.solver->error().total, fresh.solver->error().total);
      EXPECT_LT(edited.awayFrom(fresh), 1.5 * stated) << width << ", seed " << seed;
      EXPECT_LT(edited.solver->linkCounters().rays, 2 * fresh.solver->linkCounters().rays) << width;
    }
  }
}

// Where an edit brings more leaves than rays have room for, all of it is shot.
TEST(MissedLamp, AnEditThatLeavesNoRoomForRaysIsSolvedByShooting) {
  auto quads = cubeQuads(8, {0, 4}, kGrey);
  LampSolve room(makeQuadScene(quads), 1, 0.1);
  ASSERT_NE(room.solver->gathered(), nullptr);
  for (int i = 0; i < 4; ++i)
    quads.push_back({{-0.4F + 0.2F * static_cast<float>(i), -0.3F, -0.4F}, {0, 0.2F, 0}, {0, 0, 0.2F}, 64, 64, {}, {}});
  const auto after = makeQuadScene(quads);
  scene::PatchMap map;
  for (std::uint32_t s = 0; s < quads.size(); ++s) {
    map.surface_before.push_back(s < 6 ? s : scene::kNone);
    map.moved.push_back(s >= 6);
    if (s >= 6) map.boxes.push_back({quads[s].origin, quads[s].origin + quads[s].du + quads[s].dv});
  }
  scene::joinBoxes(map.boxes);
  map.leaf_altered.assign(after.patches->leaves.size(), false);
  for (std::size_t leaf = std::size_t{6} * 64; leaf < map.leaf_altered.size(); ++leaf) map.leaf_altered[leaf] = true;
  ASSERT_TRUE(room.rays.setScene(after.patches));
  for (const bool fits : {true, false}) {
    room.settings.link_memory = fits ? std::size_t{1} << 30 : 8'000'000;
    ASSERT_EQ(LinkedSolver::mayGather(*after.patches, room.settings), fits);
    const FormerSolver former{*room.solver, map, true};
    const auto edited = makeSolver(after.patches, after.materials, room.rays, room.settings, {}, &former);
    EXPECT_NE(edited->hasFluxScale(), fits);
    EXPECT_EQ(edited->isRepairing() || edited->linkCounters().samples > 0, fits) << "what was measured is kept";
  }
}

}  // namespace
}  // namespace radiosity::solver
