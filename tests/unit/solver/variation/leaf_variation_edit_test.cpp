// After something moved in a room: paths that are taken over are those that would be found anew.
#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <utility>

#include "server/solver/variation/leaf_variation.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

/// The inside of a cube with a lamp in it, and in its middle a screen that moves. Leaves are so small that what changes
/// is near to none, and all paths of walls are over other walls.
class MovedScreenTest : public testing::Test {
 protected:
  static constexpr std::uint32_t kLeaves = 12;
  static constexpr std::size_t kWalls = 6;
  using Tells = LeafVariation::Tells;
  static constexpr double kAlways = -1.0;  ///< below any error: what varies is corrected even where it may be chance

  explicit MovedScreenTest(float bottom = -0.05F)
      : before_(makeScene(-0.02F, bottom)), after_(makeScene(0.02F, bottom)), sides_(makeSides(*after_.patches)) {
    const std::size_t values = sides_.back().first_value + sides_.back().leaf_count;
    reflectance_.assign(values, glm::vec3(0.8F));
    emission_.assign(values, glm::vec3(0.0F));
    for (std::size_t value = 0; value < values; ++value)
      irradiance_.emplace_back(1.0F + 0.01F * static_cast<float>(value * value % 13), 1.0F, 1.0F);
    change_.altered.assign(values, false);
    for (auto value = sides_[kWalls].first_value; value < values; ++value) change_.altered[value] = true;
    for (const float x : {-0.02F, 0.02F}) change_.boxes.push_back({{x, bottom, -0.05F}, {x, bottom + 0.1F, 0.05F}});
    change_.came = {change_.boxes.back()};
    same_.assign(values, scene::kNone);
    for (std::uint32_t value = 0; value < values; ++value)
      if (!change_.altered[value]) same_[value] = value;
    lamps_.push_back(makeLamp({0.38F, -0.3F, 0.38F}, 1));
  }

  static test::QuadScene makeScene(float x, float bottom) {
    auto quads = test::cubeQuads(kLeaves, {}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F});
    quads.push_back({{x, bottom, -0.05F}, {0.0F, 0.1F, 0.0F}, {0.0F, 0.0F, 0.1F}});
    quads.back().width = quads.back().height = 2;
    return test::makeQuadScene(quads);
  }
  static LightPolygon makeLamp(const glm::vec3& corner, std::uint64_t key) {
    LightPolygon lamp;
    const glm::vec3 along(0.1F, 0.0F, 0.0F), across(0.0F, 0.0F, 0.1F);
    lamp.corners = {corner, corner + along, corner + along + across, corner + across};
    lamp.corner_count = 4;
    lamp.normal = {0.0F, -1.0F, 0.0F};
    lamp.emission = glm::vec3(30.0F);
    lamp.area = 0.01;
    lamp.key = key;
    return lamp;
  }
  /// Of the scene before, with more paths where they help.
  [[nodiscard]] std::unique_ptr<LeafVariation> refined() const {
    auto former = std::make_unique<LeafVariation>(*before_.patches, sides_, 1);
    former->update(light(), kAlways);
    for (int round = 0; round < 3 && former->refine(); ++round) former->update(light(), kAlways);
    EXPECT_TRUE(former->corrects());
    return former;
  }
  [[nodiscard]] LeafLight light() const { return {emission_, reflectance_, {irradiance_, irradiance_}, lamps_, {}}; }

  /// Whether what was taken over by this change is what is found anew by as many paths.
  [[nodiscard]] bool isFoundAnew(const LeafVariation& former, const Shadows* change,
                                 std::span<const LightPolygon> lights) const {
    const Shadows whole(*after_.patches, sides_, change_);
    const auto reach = static_cast<float>(former.nearest());
    std::vector<Tells> tells(same_.size(), Tells::kNothing);
    for (const auto value : same_) {
      if (value == scene::kNone) continue;
      tells[value] = whole.changesWithin(value, reach) ? Tells::kByWay : Tells::kAll;
    }
    LeafVariation anew(*after_.patches, sides_, 1), kept(*after_.patches, sides_, 1);
    anew.inherit(former, same_, std::vector(same_.size(), Tells::kNothing));
    kept.inherit(former, same_, tells, change, lights);
    anew.update(light(), kAlways);
    kept.update(light(), kAlways);
    EXPECT_TRUE(anew.corrects() && kept.corrects());
    const bool same = anew.left() == kept.left() && anew.noise() == kept.noise();
    return same && std::ranges::equal(anew.corrections(), kept.corrections());
  }

  test::QuadScene before_, after_;
  std::vector<Side> sides_;
  std::vector<glm::vec3> emission_, reflectance_, irradiance_;
  std::vector<std::uint32_t> same_;  ///< by leaf value: what it was before
  std::vector<LightPolygon> lamps_;
  GeometryChange change_;
};

TEST_F(MovedScreenTest, PathsThatPassNothingThatChangedAreKeptAndOthersAreNot) {
  const auto refined = this->refined();
  const auto& former = *refined;
  const Shadows change(*after_.patches, sides_, change_);
  for (const auto value : same_)
    ASSERT_TRUE(value == scene::kNone || !change.changesWithin(value, static_cast<float>(former.nearest())));
  EXPECT_TRUE(isFoundAnew(former, &change, lamps_));
  EXPECT_TRUE(isFoundAnew(former, nullptr, lamps_));
  // Were paths kept whatever passes them, it would show.
  const Shadows nothing(*after_.patches, sides_, {{}, {}, std::vector<bool>(same_.size(), false)});
  EXPECT_FALSE(isFoundAnew(former, &nothing, lamps_));
  // That paths are kept by this change as well: they tell of the lamp where it was, which it must not be said to be.
  const auto lamps = std::exchange(lamps_, {makeLamp({-0.4F, -0.2F, -0.4F}, lamps_[0].key)});
  EXPECT_TRUE(isFoundAnew(former, nullptr, lamps_));
  EXPECT_FALSE(isFoundAnew(former, &change, lamps));
}

/// The same right above the floor: some of its paths, and of the walls', met the screen, or meet it now.
class ScreenNearTheFloorTest : public MovedScreenTest {
 protected:
  ScreenNearTheFloorTest() : MovedScreenTest(-0.48F) {}
};

TEST_F(ScreenNearTheFloorTest, PathsWhoseWaysPassNothingThatChangedAreKeptAndOthersAreNot) {
  const auto refined = this->refined();
  const auto& former = *refined;
  const Shadows change(*after_.patches, sides_, change_);
  const auto reach = static_cast<float>(former.nearest());
  ASSERT_TRUE(std::ranges::any_of(
      same_, [&](std::uint32_t value) { return value != scene::kNone && change.changesWithin(value, reach); }));
  EXPECT_TRUE(isFoundAnew(former, &change, lamps_));
  EXPECT_TRUE(isFoundAnew(former, nullptr, lamps_));
  // Were the ways not asked, paths that the screen has come to stand in would be missing.
  const Shadows nothing(*after_.patches, sides_, {{}, {}, std::vector<bool>(same_.size(), false)});
  EXPECT_FALSE(isFoundAnew(former, &nothing, lamps_));
}

TEST_F(MovedScreenTest, WhereOtherLampsShineByThenAllIsFoundAnew) {
  LeafVariation former(*before_.patches, sides_, 1);
  former.update(light(), kAlways);
  const Shadows change(*after_.patches, sides_, change_);
  const auto lamps = lamps_;
  lamps_.push_back(makeLamp({-0.4F, 0.2F, -0.4F}, 7));
  EXPECT_TRUE(isFoundAnew(former, &change, lamps));
  lamps_[0].emission = glm::vec3(0.0F);
  EXPECT_TRUE(isFoundAnew(former, &change, lamps));
}

}  // namespace
}  // namespace radiosity::solver
