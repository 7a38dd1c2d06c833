// Very many edits of light and colour, and back: nothing drifts, because nothing is accumulated.
#include <gtest/gtest.h>

#include <cstdio>
#include <ctime>
#include <random>

#include "tests/accuracy/stress/stress_solve.h"

namespace radiosity::accuracy {
namespace {

/// `edits` of one surface's emission or reflectance at random, each from where the one before left off, then all of
/// them taken back in the opposite order. `check_every`: how often on the way back the light is looked at.
void editAndTakeBack(int edits, int check_every, std::uint64_t texels, double target_error) {
  const auto loaded = load(litRoom(), texels);
  solver::SolverSettings settings;
  settings.target_error = target_error;
  Solve solve(loaded, settings);
  ASSERT_TRUE(solve.run());
  // So strong and so few that the links there are carry it all: then the light is a function of the links alone.
  solve.solver().setTargetError(1.0);
  solve.solver().setMaterials(loaded.materials);
  ASSERT_TRUE(solve.run());
  // What was told for the tighter target would be told again: 32 others take its place.
  auto others = loaded.materials;
  for (int k = 1; k <= 40; ++k) {
    others.reflectance.fill(0, glm::vec3(static_cast<float>(k) / 41.0F));
    ASSERT_TRUE(solve.edit(others));
  }
  ASSERT_TRUE(solve.edit(loaded.materials));
  const auto before = solve.solver().irradiance();
  const auto shots = solve.solver().shots();
  std::mt19937 random(3);
  std::uniform_real_distribution<float> uniform(0.0F, 0.99F);
  struct Old {
    std::uint32_t surface;
    bool emission;
    glm::vec3 value;
  };
  std::vector<Old> olds;
  auto materials = loaded.materials;
  const auto set = [&](const Old& edit) {
    const auto& surface = loaded.patches->surfaces[edit.surface];
    auto& colours = edit.emission ? materials.emission : materials.reflectance;
    const glm::vec3 old = colours[surface.first_node[0]];
    colours.fill(colours.sideOf(surface.first_node[0]), edit.value);
    ASSERT_TRUE(solve.edit(materials));
    olds.push_back({edit.surface, edit.emission, old});
  };
  std::vector<std::vector<glm::vec3>> seen;
  std::size_t changed = 0;
  const auto begin = std::clock();
  for (int i = 0; i < edits; ++i) {
    const auto surface = static_cast<std::uint32_t>(random() % loaded.patches->surfaces.size());
    const bool emission = loaded.materials.emission[loaded.patches->surfaces[surface].first_node[0]].x > 0.0F;
    const float size = emission ? 60.0F : 1.0F;
    if (i % check_every == 0) seen.push_back(solve.solver().irradiance());
    set({surface, emission, size * glm::vec3(uniform(random), uniform(random), uniform(random))});
    if (i % check_every == 0 && solve.solver().irradiance() != seen.back()) ++changed;
  }
  // Not all: a side that receives next to nothing is too weak to shoot, whatever its colour.
  EXPECT_GT(2 * changed, seen.size()) << "edits do nothing";
  const auto done = olds;
  for (int i = edits; i-- > 0;) {
    set(done[static_cast<std::size_t>(i)]);
    if (i % check_every == 0) {
      ASSERT_EQ(solve.solver().irradiance(), seen[static_cast<std::size_t>(i / check_every)]);
    }
  }
  EXPECT_EQ(solve.solver().irradiance(), before);
  EXPECT_EQ(solve.solver().shots(), shots) << "no new link was needed";
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  std::printf("%d edits and back: %.3f ms of processor time each\n", edits, 500.0 * seconds / edits);
}

TEST(Edits, ByTheHundredAndBackGiveTheSameBits) { editAndTakeBack(150, 10, 800, 0.02); }

/// Minutes, though the room has few texels: run by hand with --gtest_also_run_disabled_tests --gtest_filter='Large*'.
TEST(LargeEdits, DISABLED_AHundredThousandAndBackGiveTheSameBits) { editAndTakeBack(100'000, 5'000, 200, 0.1); }

}  // namespace
}  // namespace radiosity::accuracy
