#include "server/solver/transport/node_shots.h"

#include <gtest/gtest.h>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::test {
namespace {

// What repairs take again, and by what weight, is known by the number of a sample alone: a node whose outline has no
// three corners is scattered, from one point each.
TEST(NodeShots, SamplesHaveTheShotAndThePointsThatTheirNumbersSay) {
  auto made = makeQuadScene({{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 8, 8, glm::vec3(1.0F), glm::vec3(0.5F)}});
  for (auto& vertex : made.patches->vertices) vertex.texel.x *= 0.5F;  // its right half lies outside of its outline
  const auto sides = solver::makeSides(*made.patches);
  const solver::NodeShots shots(*made.patches, sides, 3);
  for (const std::uint32_t x : {1U, 6U}) {
    const solver::NodePlace node{0, 0, x, 4};
    ASSERT_TRUE(shots.gathers(node));
    for (std::uint32_t index = 0; index < 6; ++index) {
      solver::ShotBatch batch;
      shots.add(node, 0, index, 32, batch);
      ASSERT_EQ(batch.gather.size() + batch.scatter.size(), 1U);
      EXPECT_EQ(batch.gather.empty(), x == 6);
      EXPECT_EQ(shots.pointsOf(node, index), batch.gather.empty() ? 1U : batch.points.size()) << x << ": " << index;
    }
    EXPECT_EQ(shots.pointsOf(node, 5), x == 6 ? 1U : solver::kMostNodePoints);
  }
}

}  // namespace
}  // namespace radiosity::test
