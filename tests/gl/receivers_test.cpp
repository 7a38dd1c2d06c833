// Bounds of blocks of receivers, by which whole blocks are left out: no place may lie outside of them.
#include "server/gpu/gather/receivers.h"

#include <gtest/gtest.h>

#include <glm/gtc/matrix_transform.hpp>
#include <glm/vector_relational.hpp>

#include "server/scene/charts/build.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::gpu {
namespace {

/// Boxes that turn, stand in each other and hover close before the ground: full leaves in and out of gaps, cut ones of
/// which places are left, and others too small for any.
scene::Scene crowded() {
  scene::Scene scene;
  for (int i = 0; i < 6; ++i) {
    auto world = glm::translate(glm::dmat4(1.0), glm::dvec3(0.7 * i - 1.8, 0.004 * i, 0.3 * (i % 3)));
    scene::test::place(scene, scene::test::box(glm::dvec3(-0.5), glm::dvec3(0.5)),
                       glm::rotate(world, 0.4 * i, glm::dvec3(0.2, 1.0, 0.1)));
  }
  return scene;
}

TEST(Receivers, EveryPlaceLiesWithinTheBoundsOfItsBlock) {
  scene::ChartOptions options;
  options.texel_budget = 3000;
  const auto patches = std::make_shared<const scene::PatchScene>(scene::buildPatchScene(crowded(), options).value());
  const Receivers receivers(patches);
  std::size_t plain = 0, cut = 0;
  for (const auto& block : receivers.blocks()) {
    const auto expectInside = [&](const glm::vec3& point) {
      EXPECT_TRUE(glm::all(glm::lessThanEqual(block.low, point)) && glm::all(glm::lessThanEqual(point, block.high)));
    };
    plain += block.plain ? block.count : 0;
    for (auto i = block.first; i < block.first + block.count; ++i) {
      const auto& receiver = receivers.all()[i];
      for (const glm::vec2& at : {glm::vec2(0.0F), {0.999F, 0.0F}, {0.3F, 0.7F}, {0.999F, 0.999F}})
        expectInside(receivers.point(receiver, at));
      if (!receiver.hasSpots()) continue;
      cut += receiver.full ? 0 : 1;
      const auto spots = receivers.spots(receiver);
      for (std::uint32_t k = 0; k < spots.count; ++k) expectInside(spots.at(k).point);
    }
  }
  EXPECT_GT(plain, 200U);
  EXPECT_GT(cut, 50U);
}

}  // namespace
}  // namespace radiosity::gpu
