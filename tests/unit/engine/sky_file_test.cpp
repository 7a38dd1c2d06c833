// The sky as viewers get it: read again by the reader of skies it is what it was, turned and as strong.
#include "server/engine/publish/sky_file.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/scene/import/sky_file.h"

namespace radiosity::engine {
namespace {

TEST(SkyFile, IsAllOfTheSkyAsItStands) {
  scene::SkyImage image{64, 32, std::vector<glm::vec3>(64 * 32, glm::vec3(1.0F))};
  for (std::size_t i = 0; i < image.texels.size(); ++i)
    if (i % 64 >= 40 && i % 64 < 56) image.texels[i] = glm::vec3(4.0F);  // around +Z
  scene::Sky sky;
  sky.upper = glm::vec3(0.5F);
  sky.picture = scene::SharedSkyPicture(std::make_shared<const scene::SkyPicture>(image));
  sky.strength = 2.0F;
  sky.turn_rad = 0.5 * std::numbers::pi;
  sky.sun = scene::SkySun{glm::normalize(glm::dvec3(-1, 1, 0)), glm::vec3(1000.0F), 0.01};
  const auto read = scene::readSkyFile(hdrOfSky(sky), "sky.hdr");
  ASSERT_TRUE(read) << read.error().text();
  const scene::SkyPicture whole(*read);
  const auto near = [&](const glm::dvec3& direction, double nits) {
    EXPECT_NEAR(static_cast<double>(whole.radiance(glm::normalize(direction)).y), nits, 0.02 * nits);
  };
  near({1, 0.2, 0}, 8.5);  // it turned from +Z towards +X
  near({1, -0.2, 0}, 8.0);
  near({-1, 0.2, 0}, 2.5);
  EXPECT_GT(whole.radiance(sky.sun->direction).y, 1e5F);
}

}  // namespace
}  // namespace radiosity::engine
