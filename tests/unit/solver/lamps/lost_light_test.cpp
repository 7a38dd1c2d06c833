// What each of a scene's lights sends.
#include "server/solver/lamps/lost_light.h"

#include <gtest/gtest.h>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

TEST(LostLight, TheFluxOfEachLightIsWhatAllHaveTogether) {
  const auto made = test::makeQuadScene(test::cubeQuads(4, {}, {}));
  LightSources sources;
  sources.lights = {{.position = {0.1, 0.2, 0.0}, .intensity = glm::vec3(5.0F)},
                    {.intensity = glm::vec3(0.0F)},
                    {.position = {0.1, 0.2, 0.0}, .intensity = glm::vec3(2.0F)}};  // in one place with the first
  sources.lights.push_back(
      {.kind = scene::LightKind::kDirectional, .direction = {0.0, -1.0, 0.0}, .intensity = glm::vec3(3.0F)});
  sources.sky = {glm::vec3(1.0F), glm::vec3(0.0F, 2.0F, 0.0F)};
  const auto each = fluxes(*made.patches, sources);
  ASSERT_EQ(each.size(), 7U);
  EXPECT_NEAR(each[0] / each[2], 2.5, 1e-6);
  EXPECT_EQ(each[1], 0.0);
  EXPECT_NEAR(each[4] / each[5], 1.5, 1e-6);
  double sum = 0.0;
  for (const double flux : each) sum += flux;
  EXPECT_NEAR(sum, totalFlux(*made.patches, sources), 1e-6 * sum);
}

}  // namespace
}  // namespace radiosity::solver
