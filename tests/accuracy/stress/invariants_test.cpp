// What must hold of every solve. Row sums: what a shooter sends either arrives, escapes or is absorbed; by construction
// the whole is what it sends up to the rounding of floats, and here it is summed from the links themselves.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "server/solver/pipeline/linked_solver.h"
#include "tests/accuracy/stress/stress_solve.h"
#include "tests/scenes/scenes.h"

namespace radiosity::accuracy {
namespace {

using solver::LinkedSolver;
using solver::Shooter;

const LinkedSolver& linked(const Solve& solve) {
  const auto* found = dynamic_cast<const LinkedSolver*>(&solve.solver());
  if (found == nullptr) throw std::runtime_error("this scene is solved without links");
  return *found;
}

/// A closed room in which squares of leaves of every wall shine so brightly that they shoot.
Loaded roomOfGlows() {
  constexpr std::uint32_t kGlow = 2, kApart = 6;
  auto loaded = load(litRoom(), 1500);
  auto& emission = loaded.materials.emission;
  for (const auto& side : solver::makeSides(*loaded.patches)) {
    if (emission.side(side.number)[0] != glm::vec3(0.0F)) continue;  // the lamp
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto x = leaf % side.width, y = leaf / side.width;
      const bool glows = (x + kApart - kGlow) % kApart < kGlow && (y + kApart - kGlow) % kApart < kGlow;
      if (glows) emission.set(side.first_node + leaf, glm::vec3(1e4F + 10.0F * static_cast<float>(leaf % 3)));
    }
  }
  return loaded;
}

/// Flux that a radiosity of one of a shooter brings to leaves [x0, x1) x [y0, y1) of a side, by half.
double fluxTo(const Solve& solve, const Shooter& shooter, std::size_t half, const solver::Side& side,
              const solver::LeafRect& rect) {
  std::vector<float> links(side.leaf_count);
  if (!shooter.column[half].decode(side.first_value, links)) return 0.0;
  double sum = 0.0;
  for (auto y = rect.y0; y < rect.y1; ++y) {
    for (auto x = rect.x0; x < rect.x1; ++x) {
      const auto leaf = y * side.width + x;
      sum += static_cast<double>(links[leaf]) * static_cast<double>(solve.patches().node_area[side.first_node + leaf]);
    }
  }
  return sum;
}

TEST(Invariants, RowSumsOfFormFactorsAreOneWithinAMillionthInAClosedRoom) {
  Solve solve(roomOfGlows());
  ASSERT_TRUE(solve.run());
  const auto sides = solver::makeSides(solve.patches());
  std::size_t rows = 0;
  for (const auto& shooter : linked(solve).system().shooters()) {
    for (std::size_t half = 0; half < 2; ++half) {
      if (shooter.column[half].points() == 0.0) continue;
      double sum = shooter.column[half].escaped() + shooter.column[half].absorbed();
      for (std::uint32_t s = 0; s < sides.size(); ++s)
        sum += fluxTo(solve, shooter, half, sides[s], {0, 0, sides[s].width, sides[s].height});
      ++rows;
      EXPECT_NEAR(sum / shooter.area, 1.0, 1e-6);
    }
  }
  EXPECT_GT(rows, 100U);
}

/// A_i F_ij = A_j F_ji, where each side of it was found by other images, and the two halves tell how far chance is off.
TEST(Invariants, LinksAreReciprocalWithinThreeSigma) {
  Solve solve(roomOfGlows());
  ASSERT_TRUE(solve.run());
  const auto sides = solver::makeSides(solve.patches());
  const auto& shooters = linked(solve).system().shooters();
  double difference = 0.0, variance = 0.0, square = 0.0;
  std::size_t pairs = 0;
  for (std::size_t i = 0; i < shooters.size(); ++i) {
    for (std::size_t j = 0; j < i; ++j) {
      if (shooters[i].isLight() || shooters[j].isLight()) continue;
      std::array<double, 2> there{}, back{};
      bool measured = true;
      for (std::size_t half = 0; half < 2; ++half) {
        measured = measured && shooters[i].column[half].points() > 0.0 && shooters[j].column[half].points() > 0.0;
        const auto to = [&](const Shooter& from, const Shooter& at) {
          const auto& side = sides[at.place.side];
          return fluxTo(solve, from, half, side, solver::leafRect(side, at.place));
        };
        there[half] = to(shooters[i], shooters[j]);
        back[half] = to(shooters[j], shooters[i]);
      }
      if (!measured || (there[0] == 0.0 && back[0] == 0.0)) continue;
      ++pairs;
      const double off = 0.5 * (there[0] + there[1]) - 0.5 * (back[0] + back[1]);
      difference += off * off;
      // Of the mean of two: a quarter of the square of their difference.
      variance += 0.25 * (std::pow(there[0] - there[1], 2) + std::pow(back[0] - back[1], 2));
      square += std::pow(0.25 * (there[0] + there[1] + back[0] + back[1]), 2);
    }
  }
  ASSERT_GT(pairs, 500U);
  RecordProperty("sigmas", std::to_string(std::sqrt(difference / variance)));
  EXPECT_LT(std::sqrt(difference), 3.0 * std::sqrt(variance));
  EXPECT_LT(std::sqrt(difference / square), 0.2) << "reciprocal, not merely uncertain";
}

TEST(Invariants, NothingIsNegativeOrInfiniteAndEnergyIsAccountedFor) {
  for (const auto& scene : {test_scenes::cornell(), test_scenes::smallRoom()}) {
    Solve solve(load(scene, 4000));
    EXPECT_TRUE(solve.run());
    expectSound(solve);
    const auto e = solve.solver().energy();
    for (std::size_t c = 0; c < 3; ++c) EXPECT_LT(std::abs(e.imbalance[c]), 0.01 * e.emitted[c]) << scene.name;
  }
}

TEST(Invariants, TheSameSeedGivesTheSameBitsOnAnyNumberOfWorkers) {
  const auto loaded = load(litRoom(), 1500);
  Solve here(loaded);
  ASSERT_TRUE(here.run());
  for (const int workers : {1, 2, 3}) {
    Solve there(loaded, {}, workers);
    ASSERT_TRUE(there.run());
    EXPECT_EQ(there.solver().irradiance(), here.solver().irradiance()) << workers;
    EXPECT_EQ(there.solver().shots(), here.solver().shots()) << workers;
  }
}

}  // namespace
}  // namespace radiosity::accuracy
