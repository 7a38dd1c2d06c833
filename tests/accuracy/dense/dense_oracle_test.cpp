// The real solver against the dense one on the same patches: other form factors, other transport, other code.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "tests/accuracy/dense/real_solve.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::Object;
using test_scenes::TestScene;

/// A closed box 1 x 0.75 x 1.25 m, every wall of another colour and three of them shining.
TestScene colouredBox() {
  TestScene scene;
  scene.name = "coloured_box";
  const test_scenes::BoxMaterials walls{
      scene.add({"red", {0.7, 0.1, 0.1}, {0, 0, 0}}),       scene.add({"green", {0.1, 0.6, 0.2}, {0.2, 0.1, 0}}),
      scene.add({"floor", {0.5, 0.5, 0.4}, {0, 0, 0}}),     scene.add({"ceiling", {0.8, 0.8, 0.8}, {3, 3, 2}}),
      scene.add({"dark", {0.02, 0.02, 0.05}, {0, 0, 0.5}}), scene.add({"white", {0.9, 0.9, 0.9}, {0, 0, 0}})};
  Object box{"box", {}, {}};
  appendBox(box, glm::dvec3(0.0), {1.0, 0.75, 1.25}, walls, test_scenes::kNoFace, true);
  scene.objects.push_back(box);
  return scene;
}

/// A closed room with a block that hangs in it: shadows, and light that goes round the block.
TestScene roomWithBlock() {
  TestScene scene;
  scene.name = "room_with_block";
  const auto wall = scene.add({"wall", {0.6, 0.5, 0.4}, {0, 0, 0}});
  const auto light = scene.add({"ceiling", {0.6, 0.6, 0.6}, {2, 2, 2}});
  const auto block = scene.add({"block", {0.3, 0.5, 0.7}, {0, 0, 0}});
  Object room{"room", {}, {}}, hanging{"block", {}, {}};
  appendBox(room, glm::dvec3(0.0), glm::dvec3(1.0), {wall, wall, wall, light, wall, wall}, test_scenes::kNoFace, true);
  appendBox(hanging, {0.25, 0.25, 0.375}, {0.75, 0.5, 0.75}, test_scenes::allFaces(block));
  scene.objects = {room, hanging};
  return scene;
}
struct Case {
  TestScene scene;
  bool occluded = false;
  double target_error = 0.01;
};

struct Outcome {
  RealSolve solve;
  oracle::DenseSolution dense;
  Difference difference;
  std::vector<oracle::Corners> occluders;
};

Outcome solveBoth(const Case& c, Method method) {
  Outcome outcome;
  outcome.solve = solveReally(c.scene, {.target_error = c.target_error, .method = method});
  if (c.occluded) outcome.occluders = oracle::allPolygons(c.scene);
  const auto patches = outcome.solve.patches();
  // Adaptive subdivision would never end at the edges of shadows: there a fixed rule.
  const oracle::IntegrationOptions integration =
      c.occluded ? oracle::IntegrationOptions{0.0, 0} : oracle::IntegrationOptions{1e-5, 4};
  outcome.dense = oracle::solveDense(patches, oracle::formFactors(patches, outcome.occluders, integration));
  outcome.difference = compare(outcome.solve, outcome.dense.irradiance_lux);
  testing::Test::RecordProperty("stated", std::to_string(outcome.solve.stated.total));
  testing::Test::RecordProperty("rms", std::to_string(outcome.difference.rms));
  testing::Test::RecordProperty("bias", std::to_string(outcome.difference.bias));
  testing::Test::RecordProperty("surface", std::to_string(outcome.difference.surface));
  return outcome;
}

/// The truth lies within this factor of a stated error: the promise of the product.
constexpr double kCalibration = 1.5;

class DenseOracle : public testing::TestWithParam<Case> {};

void expectTheIrradianceOfEveryTexel(const Case& c, Method method, std::uint64_t seeds = 1) {
  const auto first = solveBoth(c, method);
  const double inside = spreadInsideTexels(first.solve, first.dense, first.occluders);
  double bias = 0.0, stated = 0.0;
  for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
    const SolveOptions options{.target_error = c.target_error, .method = method, .seed = seed};
    const auto solve = seed == 1 ? first.solve : solveReally(c.scene, options);
    const auto difference = compare(solve, first.dense.irradiance_lux);
    // A round looks at one point of each texel, for both of the halves whose difference is the stated sampling error:
    // what that costs is not stated.
    const double points = inside / std::sqrt(solve.rounds);
    EXPECT_LT(difference.rms, std::hypot(kCalibration * solve.stated.total, points));
    // Points average out over a surface's texels.
    EXPECT_LT(difference.surface, 0.01);
    bias += difference.bias;
    stated += solve.stated.total;
    testing::Test::RecordProperty("bias_" + std::to_string(seed), std::to_string(difference.bias));
    testing::Test::RecordProperty("stated_" + std::to_string(seed), std::to_string(solve.stated.total));
  }
  // Nothing is lost: the sum over all texels is far better than one of them.
  EXPECT_LT(std::abs(bias), 0.5 * stated);
}

TEST_P(DenseOracle, RaysBringTheIrradianceOfEveryTexel) {
  expectTheIrradianceOfEveryTexel(GetParam(), Method::kGather);
}

// A shot is from one point, whose light is off alike at all texels that it reaches, so that only seeds average: between
// perpendicular plates each of four is off by 0.17 to 0.74 of the stated error in all, their mean by 0.11.
TEST_P(DenseOracle, AveragedShootingBringsTheIrradianceOfEveryTexel) {
  expectTheIrradianceOfEveryTexel(GetParam(), Method::kShooting, 4);
}

TEST_P(DenseOracle, ThePaperModeHasTheLightOfEverySurfaceAndBlursItInside) {
  const auto [solve, dense, difference, occluders] = solveBoth(GetParam(), Method::kPaper);
  // Some hundred hemicubes of 32 to 256 pixels, each from one place of its shooter: a surface's light is the mean of
  // few of them, of which the method itself states nothing. 4, 8 and 12 % of the worst surface in three scenes.
  constexpr double kChance = 0.15;
  EXPECT_LT(difference.surface, kChance);
  // A bias of one level makes links one to two levels coarser than what a pixel sees, and the Gaussian spreads further:
  // like the means of blocks of 4 x 4 texels.
  const double blur = spreadInsideBlocks(solve, dense.irradiance_lux, 4);
  EXPECT_LT(difference.rms, std::hypot(kChance, blur));
  EXPECT_LT(std::abs(difference.bias), solve.stated.residual + 0.01) << "what is still unshot is all that is missing";
}

INSTANTIATE_TEST_SUITE_P(Scenes, DenseOracle,
                         testing::Values(Case{colouredBox(), false, 0.005},
                                         Case{test_scenes::parallelPlates(1, 1, 1, 1, 0.5)},
                                         Case{test_scenes::perpendicularPlates(1, 1, 1, 1, 0.5)},
                                         Case{roomWithBlock(), true}),
                         [](const auto& info) { return info.param.scene.name; });

/// Radiosity of the six faces of the lumped unit cube, one texel each: the floor that shines, the ceiling, a side.
struct LumpedCube {
  double reflectance;
  std::array<double, 3> radiosity_lux;
};

class LumpedUnitCube : public testing::TestWithParam<LumpedCube> {
 protected:
  /// The exact radiosity of the face.
  [[nodiscard]] static double exact(const SolvedTexel& face) {
    const auto normal = oracle::unitNormal(face.patch.corners);
    return GetParam().radiosity_lux[normal.y > 0.5 ? 0 : normal.y < -0.5 ? 1 : 2];
  }
  [[nodiscard]] static RealSolve solve(Method method, std::uint64_t seed = 1) {
    const auto cube = test_scenes::lumpedCube(GetParam().reflectance);
    return solveReally(cube, {.texel_size_m = 1.0, .target_error = 0.004, .method = method, .seed = seed});
  }
  [[nodiscard]] static double found(const SolvedTexel& face) {
    return face.patch.emission_lux.x + face.patch.reflectance.x * face.irradiance_lux.x;
  }
};

TEST_P(LumpedUnitCube, HasTheExactRadiosityOfEveryFace) {
  const auto cube = solve(Method::kGather);
  ASSERT_EQ(cube.texels.size(), 6U);
  double all = 0.0, exact_all = 0.0;
  for (const auto& face : cube.texels) {
    // One point a round stands for a whole wall, on which irradiance varies by a quarter: some 15 rounds leave a
    // percent.
    EXPECT_NEAR(found(face) / exact(face), 1.0, 0.02);
    all += found(face) - face.patch.emission_lux.x;
    exact_all += exact(face) - face.patch.emission_lux.x;
  }
  // Every shooter's flux is kept to the 12 bits of a link.
  EXPECT_NEAR(all / exact_all, 1.0, 0.0005) << "light is lost";
  EXPECT_LT(std::abs(cube.energy.imbalance[0]), 0.001) << "of 1 lm emitted";
}

// A hemicube at one place of a wall stands for all of the wall: what a face gets differs by nearly half from seed to
// seed. Over many seeds that averages out (over 500 of them each face is within 3 %).
TEST_P(LumpedUnitCube, IsRightInTheMeanInPaperMode) {
  constexpr std::uint64_t kSeeds = 48;
  double sum = 0.0, count = 0.0;
  for (std::uint64_t seed = 1; seed <= kSeeds; ++seed) {
    const auto cube = solve(Method::kPaper, seed);
    ASSERT_EQ(cube.texels.size(), 6U);
    for (const auto& face : cube.texels) {
      if (face.patch.emission_lux.x > 0.0) continue;
      sum += found(face) / exact(face);
      count += 1.0;
    }
    EXPECT_LT(std::abs(cube.energy.imbalance[0]), 0.001) << "of 1 lm emitted";
  }
  EXPECT_NEAR(sum / count, 1.0, 3.0 * 0.45 / std::sqrt(count)) << "three standard errors";
}

INSTANTIATE_TEST_SUITE_P(Reflectance, LumpedUnitCube,
                         testing::Values(LumpedCube{0.5, {1.0909090981, 0.1817458261, 0.1818362689}},
                                         LumpedCube{0.9, {2.3728813748, 1.5253105511, 1.5254520185}}),
                         [](const auto& info) { return std::to_string(std::lround(100.0 * info.param.reflectance)); });

}  // namespace
}  // namespace radiosity::accuracy
