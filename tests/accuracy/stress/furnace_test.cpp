// Furnaces: closed, the same emission E and reflectance rho everywhere, so that H = E / (1 - rho) whatever the shape.
// Near one an error of any column of links is multiplied by 1 / (1 - rho), and so is what a linear solver leaves.
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <string>

#include "tests/accuracy/stress/stress_solve.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {
namespace {

using test_scenes::TestScene;

/// A block in the middle, whose faces see each other not at all and the walls in part.
TestScene furnaceWithBlock() {
  auto scene = test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0));
  scene.name = "furnace_with_block";
  test_scenes::Object block{"block", {}, {}};
  appendBox(block, {0.3, 0.3, 0.3}, {0.6, 0.7, 0.6}, test_scenes::allFaces(0));
  scene.objects.push_back(block);
  return scene;
}

class Furnace : public testing::TestWithParam<float> {
 protected:
  /// Past the importer's clamp to 0.999. What is found goes into the test's report.
  static FromConstant found(const TestScene& scene, std::uint64_t texels, double target) {
    auto loaded = load(scene, texels);
    paint(loaded, GetParam());
    solver::SolverSettings settings;
    settings.target_error = target;
    Solve solve(loaded, settings);
    EXPECT_TRUE(solve.run());
    expectSound(solve);
    const auto off = compareToConstant(solve, std::numbers::pi / (1.0 - static_cast<double>(GetParam())));
    RecordProperty("mean", std::to_string(off.mean));
    RecordProperty("rms", std::to_string(off.rms));
    RecordProperty("stated", std::to_string(solve.solver().error().total));
    return off;
  }
};

TEST_P(Furnace, HasItsIrradianceWithinATenthOfAPercent) {
  const auto off = found(test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(1.0)), 2400, 0.001);
  EXPECT_LT(off.rms, 0.001);
  // No light is lost but by the rounding of floats: a few 1e-9 a bounce, and once that of the irradiance itself.
  EXPECT_LT(std::abs(off.mean), 1e-8 / (1.0 - static_cast<double>(GetParam())) + 1e-7);
}

TEST_P(Furnace, KeepsItsLightAroundABlock) {
  const auto off = found(furnaceWithBlock(), 2400, 0.01);
  EXPECT_LT(std::abs(off.mean), 0.001);
}

INSTANTIATE_TEST_SUITE_P(Reflectance, Furnace, testing::Values(0.5F, 0.99F, 0.999F, 0.9999F),
                         [](const auto& info) { return std::to_string(std::lround(info.param * 10000.0F)); });

TEST(WhiteFurnace, IsLitAsOneOfTheImportersLargestReflectance) {
  const auto loaded = load(test_scenes::furnace(glm::dvec3(1.0), glm::dvec3(1.0)), 600);
  EXPECT_FALSE(loaded.materials.warnings.empty()) << "the clamp is a warning";
  Solve solve(loaded);
  EXPECT_TRUE(solve.run());
  const double rho = static_cast<double>(0.999F);
  EXPECT_LT(std::abs(compareToConstant(solve, std::numbers::pi / (1.0 - rho)).mean), 0.001);
}

}  // namespace
}  // namespace radiosity::accuracy
