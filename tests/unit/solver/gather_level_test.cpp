// The level of what is gathered, where few rays know it badly.
#include <gtest/gtest.h>

#include <cmath>

#include "server/solver/leaf_gather.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;
using test::Quad;

struct Level {
  explicit Level(const std::vector<Quad>& quads)
      : scene(makeQuadScene(quads)), sides(makeSides(*scene.patches)), gather(*scene.patches, sides, 1, 1U << 28U) {
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

}  // namespace
}  // namespace radiosity::solver
