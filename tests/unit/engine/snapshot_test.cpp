// Pictures of the engine: how bright they are beside a sky. They are drawn by OpenGL, and left out where there is none.
#include <gtest/gtest.h>

#include "tests/unit/engine/block_room.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

class SnapshotTest : public EngineTest {
 protected:
  /// Of the room's picture from outside, through the backs of its walls, which let no sky in; 0: there is no OpenGL.
  double exposureBeside(const std::optional<engine::SkySetting>& sky, const glm::dvec3& target, std::string quantity) {
    auto room = blockRoom();
    room.camera.position = {1.0, 1.0, 6.0};
    room.camera.target = target;
    EXPECT_TRUE(configure([&](auto& settings) {
      settings.sky = sky;
      settings.target_error = kEasy;
    }));
    solve(room);
    engine::SnapshotRequest request;
    request.width = 64;
    request.height = 48;
    request.quantity = std::move(quantity);
    const auto picture = call<engine::Snapshot>([&](auto done) { engine().snapshot(request, {}, done); });
    return picture && picture->exposure ? *picture->exposure : 0.0;
  }
};

constexpr glm::dvec3 kRoom(1.0, 1.0, 0.0), kAway(1.0, 4.0, 20.0);

TEST_F(SnapshotTest, ASkyBehindTheSceneDoesNotRuleItsExposure) {
  const double alone = exposureBeside(std::nullopt, kRoom, "lit");
  if (alone == 0.0) GTEST_SKIP() << "no OpenGL";
  const double bright = exposureBeside(engine::SkySetting{glm::vec3(1e5F), glm::vec3(1e5F)}, kRoom, "lit");
  EXPECT_NEAR(bright / alone, 1.0, 0.2) << "two solves to 20 %, of which the sky takes no part";
}

TEST_F(SnapshotTest, APictureOfNothingButSkyIsExposedForIt) {
  if (exposureBeside(std::nullopt, kRoom, "lit") == 0.0) GTEST_SKIP() << "no OpenGL";
  const double sky = exposureBeside(engine::SkySetting{glm::vec3(500.0F), glm::vec3(500.0F)}, kAway, "lit");
  EXPECT_NEAR(sky * 500.0, 0.18, 1e-3);
  const double none = exposureBeside(engine::SkySetting{glm::vec3(500.0F), glm::vec3(500.0F)}, kAway, "irradiance");
  EXPECT_EQ(none, 1.0) << "no light arrives where nothing is";
}

}  // namespace
}  // namespace radiosity::test
