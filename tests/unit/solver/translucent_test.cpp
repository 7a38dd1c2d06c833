// Light that passes translucent quads, in all three solvers: B = E + rho H + tau H of the other side.
#include <gtest/gtest.h>

#include <cmath>

#include "server/solver/paper/paper_solver.h"
#include "server/solver/patches/passing.h"
#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/shooting/shooting_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::kDark;
using test::kGrey;
using test::makeQuadScene;
using test::Quad;
using test::RayTransport;

constexpr std::size_t kSheet = 10;

/// Cubes of side 1 on both sides of a sheet, x = 0, whose front faces the second: five walls of each, then the sheet.
std::vector<Quad> twoCubes(const Quad& sheet, float emission_of_first, float emission_of_second, float reflectance) {
  std::vector<Quad> quads;
  for (int cube = 0; cube < 2; ++cube) {
    auto walls = cubeQuads(8, kDark, kGrey);
    walls.erase(walls.begin() + (cube == 0 ? 5 : 4));
    for (auto& wall : walls) {
      wall.origin.x += cube == 0 ? -0.5F : 0.5F;
      wall.emission = glm::vec3(cube == 0 ? emission_of_first : emission_of_second);
      wall.reflectance = glm::vec3(reflectance);
      quads.push_back(wall);
    }
  }
  quads.push_back(sheet);
  return quads;
}

Quad sheetOf(const glm::vec3& reflectance, const glm::vec3& transmittance, float emission = 0.0F) {
  return {{0.0F, -0.5F, -0.5F}, {0, 1, 0}, {0, 0, 1}, 8, 8, glm::vec3(emission), reflectance, transmittance};
}

/// Over one side of a surface.
glm::dvec3 meanOf(const Solver& solver, const scene::PatchScene& patches, std::size_t surface, std::size_t face = 0) {
  const auto& of = patches.surfaces[surface];
  const auto light = solver.irradiance();
  glm::dvec3 sum(0.0);
  for (std::uint32_t leaf = 0; leaf < of.width * of.height; ++leaf)
    sum += glm::dvec3(light[of.first_node[face] + leaf]);
  return sum / static_cast<double>(of.width * of.height);
}

glm::dvec3 meanOfWalls(const Solver& solver, const scene::PatchScene& patches, std::size_t first) {
  glm::dvec3 sum(0.0);
  for (std::size_t wall = first; wall < first + 5; ++wall) sum += meanOf(solver, patches, wall) / 5.0;
  return sum;
}

struct Solved {
  Solved(const std::vector<Quad>& quads, Method method, double target) : made(makeQuadScene(quads)), rays(256) {
    EXPECT_TRUE(rays.setScene(made.patches));
    settings.method = method;
    settings.target_error = target;
    if (method == Method::kGather)
      solver = std::make_unique<LinkedSolver>(made.patches, made.materials, rays, settings);
    else if (method == Method::kShooting)
      solver = std::make_unique<ShootingSolver>(made.patches, made.materials, rays, settings);
    else
      solver = std::make_unique<PaperSolver>(made.patches, made.materials, rays, settings);
    test::solve(*solver);
  }
  void expectBalanced() const {
    const auto energy = solver->energy();
    for (std::size_t c = 0; c < 3; ++c) {
      const double sum = energy.absorbed[c] + energy.escaped[c] + energy.backface[c] + energy.unshot[c];
      EXPECT_NEAR(sum + energy.imbalance[c], energy.emitted[c], 1e-5 * energy.emitted[c]);
      EXPECT_NEAR(energy.absorbed[c] + energy.unshot[c], energy.emitted[c], 0.005 * energy.emitted[c])
          << "a closed scene keeps its light";
    }
  }

  test::QuadScene made;
  RayTransport rays;
  SolverSettings settings;
  std::unique_ptr<Solver> solver;
};

class AnyMethod : public testing::TestWithParam<Method> {
 protected:
  [[nodiscard]] static bool gathers() { return GetParam() == Method::kGather; }
};
INSTANTIATE_TEST_SUITE_P(Translucent, AnyMethod, testing::Values(Method::kGather, Method::kShooting, Method::kPaper),
                         [](const auto& info) {
                           return std::string(kMethodNames[static_cast<std::size_t>(info.param)]);
                         });

// The walls of the first cube are black and shine: whatever the sheet sends back they keep, so that its back has 1 lux.
// Its front sends tau of that, all of which arrives on five walls as large.
TEST_P(AnyMethod, ADarkCubeGetsTheTransmittanceOfWhatArrivesBehindItsSheet) {
  const glm::vec3 tau(0.6F, 0.3F, 0.1F);
  const double target = GetParam() == Method::kPaper ? 0.002 : gathers() ? 0.01 : 0.03;
  const Solved two(twoCubes(sheetOf(glm::vec3(0.2F), tau), 1.0F, 0.0F, 0.0F), GetParam(), target);
  two.expectBalanced();
  const auto& patches = *two.made.patches;
  // Of hemicubes' and few light points' own errors: as AnySolver has them for a furnace.
  const auto behind = meanOf(*two.solver, patches, kSheet, 1), before = meanOf(*two.solver, patches, kSheet, 0);
  const auto walls = meanOfWalls(*two.solver, patches, 5);
  for (int c = 0; c < 3; ++c) {
    EXPECT_NEAR(behind[c], 1.0, 0.03);
    EXPECT_NEAR(before[c], 0.0, 1e-6) << "black walls send nothing back";
    // What the other two leave unshot is stated as a part of all light, of which the second cube has a tenth or less.
    const double off = gathers() ? 0.01 : GetParam() == Method::kPaper ? 0.03 : 0.1;
    EXPECT_NEAR(5.0 * walls[c] / behind[c], static_cast<double>(tau[c]), off * static_cast<double>(tau[c])) << c;
  }
}

// Walls and sheet shine alike, and what the sheet reflects and lets through is what walls reflect: B = E / (1 - rho).
TEST_P(AnyMethod, AFurnaceDividedByASheetIsStillAFurnace) {
  const Solved two(twoCubes(sheetOf(glm::vec3(0.3F), glm::vec3(0.4F), 1.0F), 1.0F, 1.0F, 0.7F), GetParam(),
                   GetParam() == Method::kShooting ? 0.05 : 0.01);
  two.expectBalanced();
  const double exact = 1.0 / (1.0 - 0.7);
  for (const std::size_t first : {0U, 5U})
    EXPECT_NEAR(meanOfWalls(*two.solver, *two.made.patches, first).x / exact, 1.0,
                GetParam() == Method::kShooting ? 0.06 : 0.03);
  for (const std::size_t face : {0U, 1U})
    EXPECT_NEAR(meanOf(*two.solver, *two.made.patches, kSheet, face).x / exact, 1.0,
                GetParam() == Method::kShooting ? 0.06 : 0.03);
}

// Of a sheet that lets through, reflecting walls on both sides: fluxes of two well mixed cubes, to what their uneven
// light is off by. Without what comes back it would be off by 30 %.
TEST_P(AnyMethod, EditsOfTheTransmittanceEndWhereAFreshSolveDoes) {
  const auto scene = [](float tau) {
    return twoCubes(sheetOf(glm::vec3(0.8F - tau), glm::vec3(tau)), 1.0F, 0.0F, 0.6F);
  };
  const double target = gathers() ? 0.01 : 0.04;
  const Solved fresh(scene(0.6F), GetParam(), target);
  Solved edited(scene(0.1F), GetParam(), target);
  const double before = meanOfWalls(*edited.solver, *edited.made.patches, 5).x;
  edited.solver->setMaterials(fresh.made.materials);
  test::solve(*edited.solver);
  edited.expectBalanced();
  const double after = meanOfWalls(*edited.solver, *edited.made.patches, 5).x;
  EXPECT_GT(after, 2.0 * before);
  EXPECT_NEAR(after / meanOfWalls(*fresh.solver, *fresh.made.patches, 5).x, 1.0, 3.0 * target);
}

TEST(PassingLeaves, AreThoseOfBothSidesInTheirOrder) {
  const auto made = makeQuadScene(twoCubes(sheetOf(glm::vec3(0.2F), glm::vec3(0.5F, 0.0F, 0.0F)), 1.0F, 0.0F, 0.5F));
  const auto sides = makeSides(*made.patches);
  const auto leaves = passingLeaves(made.materials.transmittance, sides, leafAreas(*made.patches, sides));
  ASSERT_EQ(leaves.size(), 128U);
  const auto& front = sides[kSheet];
  const auto& back = sides[front.other];
  EXPECT_EQ(back.other, front.number);
  EXPECT_EQ(sides[0].other, scene::kNone);
  for (std::uint32_t leaf = 0; leaf < 64; ++leaf) {
    EXPECT_EQ(leaves[leaf].to, front.first_value + leaf);
    EXPECT_EQ(leaves[leaf].from, back.first_value + leaf);
    EXPECT_EQ(leaves[64 + leaf].to, back.first_value + leaf);
  }
  EXPECT_EQ(passingTo(leaves, front).size(), 64U);
  EXPECT_TRUE(passingTo(leaves, sides[3]).empty());
  EXPECT_TRUE(passingLeaves({}, sides, leafAreas(*made.patches, sides)).empty());
}

}  // namespace
}  // namespace radiosity::solver
