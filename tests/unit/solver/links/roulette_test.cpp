#include "server/solver/links/roulette.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::test {
namespace {

constexpr std::uint32_t kTiles = 16;  ///< a side

/// A floor of many small tiles, 4 x 4 leaves each.
QuadScene tiles() {
  std::vector<Quad> quads;
  const float size = 1.0F / kTiles;
  for (std::uint32_t i = 0; i < kTiles * kTiles; ++i) {
    const glm::vec3 corner(size * static_cast<float>(i % kTiles) - 0.5F, 0.0F,
                           size * static_cast<float>(i / kTiles) - 0.5F);
    quads.push_back({corner, {0.0F, 0.0F, size}, {size, 0.0F, 0.0F}, 4, 4, glm::vec3(0.0F), glm::vec3(0.5F)});
  }
  return makeQuadScene(quads);
}

TEST(RouletteDraws, AreUniformOverSeeds) {
  const auto scene = tiles();
  const auto sides = solver::makeSides(*scene.patches);
  for (const solver::NodePlace node : {solver::NodePlace{17, 2, 0, 0}, solver::NodePlace{200, 0, 3, 2}}) {
    constexpr int kSeeds = 4096;
    double sum = 0.0, square = 0.0, product = 0.0;
    for (std::uint64_t seed = 0; seed < kSeeds; ++seed) {
      const solver::RouletteDraws draws(*scene.patches, sides, seed);
      const double first = draws.draw(node, 0), second = draws.draw(node, 1);
      ASSERT_GE(first, 0.0);
      ASSERT_LT(first, 1.0);
      sum += first;
      square += first * first;
      product += (first - 0.5) * (second - 0.5);
    }
    // Five standard errors of 4096 uniform values: of the mean 0.0045, of the square's 0.0047, of the product 0.0013.
    EXPECT_NEAR(sum / kSeeds, 0.5, 5 * 0.0045);
    EXPECT_NEAR(square / kSeeds, 1.0 / 3.0, 5 * 0.0047);
    EXPECT_NEAR(product / kSeeds, 0.0, 5 * 0.0013) << "halves are independent";
  }
}

// Independent draws would spread the winners among 64 tiles by sqrt(64 p (1 - p)) = 2.6 at p = 1/8.
TEST(RouletteDraws, AsManyNeighboursWinAsShould) {
  const auto scene = tiles();
  const auto sides = solver::makeSides(*scene.patches);
  for (std::uint64_t seed = 0; seed < 20; ++seed) {
    const solver::RouletteDraws draws(*scene.patches, sides, seed);
    for (std::uint32_t quarter = 0; quarter < 4; ++quarter) {
      int roots = 0;
      for (std::uint32_t i = 0; i < 64; ++i) {
        const std::uint32_t x = 8 * (quarter % 2) + i % 8, y = 8 * (quarter / 2) + i / 8;
        if (draws.draw({y * kTiles + x, 2, 0, 0}, 0) < 0.125) ++roots;
      }
      EXPECT_NEAR(roots, 8, 1);
    }
    int leaves = 0;  // of 16 tiles in a corner
    for (std::uint32_t i = 0; i < 256; ++i) {
      const std::uint32_t tile = i / 16;
      if (draws.draw({tile / 4 * kTiles + tile % 4, 0, i % 4, i / 4 % 4}, 1) < 0.125) ++leaves;
    }
    EXPECT_NEAR(leaves, 32, 1);
  }
}

}  // namespace
}  // namespace radiosity::test
