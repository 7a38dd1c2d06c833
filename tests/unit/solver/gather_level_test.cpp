// The level of what is gathered, where few rays know it badly.
#include <gtest/gtest.h>

#include <cmath>

#include "server/solver/reflected/leaf_gather.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;
using test::Quad;

struct Level {
  explicit Level(const std::vector<Quad>& quads) : Level(makeQuadScene(quads)) {}
  explicit Level(test::QuadScene made)
      : scene(std::move(made)), sides(makeSides(*scene.patches)), gather(*scene.patches, sides, 1, 1U << 28U) {
    gather.start();
    for (const auto& side : sides) {
      light.emission.insert(light.emission.end(), side.leaf_count, scene.materials.emission[side.first_node]);
      light.reflectance.insert(light.reflectance.end(), side.leaf_count, scene.materials.reflectance[side.first_node]);
    }
    for (auto& half : light.irradiance) half.assign(light.emission.size(), glm::vec3(0.0F));
    light.shot = light.irradiance;
  }
  /// Flux that is sent and neither arrives nor is lost, of all that arrives.
  double imbalance() {
    gather.begin(light);
    while (!gather.advance(0.001)) continue;
    double sent = 0.0, arrived = 0.0, all = 0.0;
    for (std::size_t half = 0; half < 2; ++half) {
      for (std::size_t v = 0; v < light.emission.size(); ++v) {
        const double area = 0.5 * static_cast<double>(scene.patches->node_area[leafNode(v)]);
        const double x = static_cast<double>(gather.irradiance(half)[v].x);
        const double over_links = static_cast<double>(light.irradiance[half][v].x);
        arrived += area * x;
        all += area * (x + over_links);
        sent += area * (static_cast<double>(light.emission[v].x) - static_cast<double>(light.shot[half][v].x) +
                        static_cast<double>(light.reflectance[v].x) * (x + over_links));
      }
    }
    return std::abs(sent - arrived - gather.escapedFlux()[0] - gather.absorbedFlux()[0]) / all;
  }
  std::size_t leafNode(std::size_t value) const {
    const auto& side = sides[gather.sights().sideOf(static_cast<std::uint32_t>(value))];
    return side.first_node + value - side.first_value;
  }

  test::QuadScene scene;
  std::vector<Side> sides;
  LeftLight light;
  LeafGather gather;
};

// A bright floor whose mean was sent over links: of its pattern as much light is missing as there is too much.
TEST(GatherLevel, OfAPatternWhoseMeanWasSentBalancesToo) {
  auto quads = cubeQuads(8, {}, {});
  quads[0].reflectance = glm::vec3(0.9F);
  Level room(quads);
  for (std::size_t half = 0; half < 2; ++half) {
    for (std::size_t v = 0; v < room.light.emission.size(); ++v) {
      const bool floor = v < 64;
      room.light.irradiance[half][v] = glm::vec3(floor ? (v % 3 == 0 ? 20.0F : 5.0F) : 2.0F);
      if (floor) room.light.shot[half][v] = glm::vec3(0.9F * (22.0F * 20.0F + 42.0F * 5.0F) / 64.0F);
    }
  }
  EXPECT_LT(room.imbalance(), 1e-6);
  for (std::size_t v = 0; v < room.light.emission.size(); ++v)
    ASSERT_GE((room.gather.irradiance(0)[v] + room.light.irradiance[0][v]).x, 0.0F) << v;
}

// Of a thousand bounces each takes a little at one small place, which few rays meet.
TEST(GatherLevel, OfABrightRoomWithOneSmallHoleBalances) {
  auto quads = cubeQuads(8, {}, {0.999F, 0.999F, 0.999F, 0.999F, 0.999F, 0.999F});
  quads.push_back({{-0.1F, 0.45F, -0.1F}, {0.2F, 0, 0}, {0, 0, 0.2F}, 2, 2, glm::vec3(20.0F)});
  quads.push_back({{0.2F, -0.49F, 0.2F}, {0, 0, 0.05F}, {0.05F, 0, 0}, 1, 1});
  EXPECT_LT(Level(quads).imbalance(), 1e-6);
}

// Walls that reach through floor and ceiling: what rays lose there was never sent, and the room keeps all of its light.
TEST(GatherLevel, OfARoomWhoseWallsReachOutLosesNothing) {
  for (const float reach : {0.01F, 0.03F, 0.1F}) {
    auto quads = cubeQuads(6, {}, {0.8F, 0.8F, 0.8F, 0.8F, 0.8F, 0.8F});
    for (auto& quad : quads) {
      if (quad.du.y == 0.0F && quad.dv.y == 0.0F) {
        if (quad.origin.y < 0.0F) quad.emission = glm::vec3(1.0F);
        continue;
      }
      auto& up = quad.du.y != 0.0F ? quad.du : quad.dv;
      const float way = up.y > 0.0F ? reach : -reach;
      quad.origin.y -= way;
      up.y += 2.0F * way;
    }
    auto made = makeQuadScene(quads);
    for (auto& leaf : made.patches->leaves) {
      const auto& frame = made.patches->triangles[leaf.triangle];
      const float y = frame.origin.y + leaf.texel.x * frame.du.y + leaf.texel.y * frame.dv.y;
      // Of walls, the leaves that floor and ceiling cut: the middles of others are farther from these.
      leaf.cut = std::abs(frame.normal.y) < 0.5F && std::abs(y) > 0.4F;
    }
    Level cut(std::move(made));
    EXPECT_LT(cut.imbalance(), 1e-6) << reach;
    double sum = 0.0, area = 0.0;
    for (std::size_t v = 0; v < cut.light.emission.size(); ++v) {
      const auto node = cut.leafNode(v);
      if (std::abs(cut.scene.patches->triangles[cut.scene.patches->leaves[v].triangle].normal.y) < 0.5F) continue;
      const double a = static_cast<double>(cut.scene.patches->node_area[node]);
      sum += 0.5 * a * static_cast<double>(cut.gather.irradiance(0)[v].x + cut.gather.irradiance(1)[v].x);
      area += a;
    }
    // By a path tracer; sixteen rays a leaf know it to 3 %.
    EXPECT_NEAR(sum / area, 0.780, 0.025) << reach;
  }
}

}  // namespace
}  // namespace radiosity::solver
