// What single leaves see of a lamp, against what can be worked out: an open room, a screen whose shadow is known.
#include "server/solver/lamps/light_sight.h"

#include <gtest/gtest.h>

#include <glm/geometric.hpp>
#include <random>
#include <vector>

#include "server/solver/math/polygon_form_factor.h"
#include "server/solver/math/sampling.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

constexpr float kRoomFloor = -0.4F, kScreen = 0.0F, kLamp = 0.4F;
constexpr std::uint32_t kRoomLeaves = 20;

/// A floor of texels 0.04 wide, a lamp above it, and maybe a screen half way up that reaches from x = 0 on to one side.
class LightSightTest : public testing::Test {
 protected:
  explicit LightSightTest() {
    lamp_.corners = {glm::vec3(-0.1F, kLamp, -0.1F), {0.1F, kLamp, -0.1F}, {0.1F, kLamp, 0.1F}, {-0.1F, kLamp, 0.1F}};
    lamp_.corner_count = 4;
    lamp_.normal = {0.0F, -1.0F, 0.0F};
    lamp_.area = 0.04;
    lamp_.key = 3;
    makeRoom(true);
  }

  void makeRoom(bool has_screen) {
    std::vector<test::Quad> quads{{{-0.4F, kRoomFloor, -0.4F}, {0.0F, 0.0F, 0.8F}, {0.8F, 0.0F, 0.0F}}};
    quads[0].width = quads[0].height = kRoomLeaves;
    if (has_screen) quads.push_back({{0.0F, kScreen, -0.49F}, {0.0F, 0.0F, 0.98F}, {0.49F, 0.0F, 0.0F}});
    scene_ = test::makeQuadScene(quads);
    sides_ = makeSides(*scene_.patches);
    rays_ = std::make_shared<const LeafRays>(*scene_.patches, sides_);
  }
  /// Mean over many places of the leaf of the exact form factor of what the screen leaves of the lamp: as seen from x
  /// the screen's edge is at -x there, and what is farther in is hidden.
  [[nodiscard]] double expected(std::uint32_t value, bool has_screen) const {
    constexpr std::uint32_t kPlaces = 4096;
    double sum = 0.0;
    for (std::uint32_t i = 0; i < kPlaces; ++i) {
      const auto at = sobol4(i, 5);
      const auto place = rays_->placeOn(value, {at.x, at.y});
      auto corners = lamp_.corners;
      const auto edge = static_cast<float>(-place.position.x);
      for (auto& corner : corners)
        if (has_screen) corner.x = glm::min(corner.x, glm::max(edge, -0.1F));
      if (corners[1].x - corners[0].x < 1e-6F) continue;
      sum += polygonFormFactor(place.position, place.normal, corners);
    }
    return sum / kPlaces;
  }

  LightPolygon lamp_;
  test::QuadScene scene_;
  std::vector<Side> sides_;
  std::shared_ptr<const LeafRays> rays_;
};

TEST_F(LightSightTest, WhereNothingHidesTheLampItIsTheFormFactor) {
  makeRoom(false);
  const LightSight sight(rays_, lamp_, 1);
  for (std::uint32_t value = 0; value < kRoomLeaves * kRoomLeaves; ++value) {
    for (std::size_t half = 0; half < 2; ++half) {
      const auto link = sight.link(value, half, 4);
      ASSERT_TRUE(link);
      // The form factor of four places; over a leaf it changes by a tenth at most.
      EXPECT_NEAR(*link, expected(value, false), 0.01 * expected(value, false)) << value;
    }
  }
}

TEST_F(LightSightTest, InAHalfShadowItIsThatOfWhatIsSeen) {
  const LightSight sight(rays_, lamp_, 1);
  double square = 0.0, differ = 0.0, all = 0.0;
  std::size_t half_lit = 0, dark = 0;
  for (std::uint32_t value = 0; value < kRoomLeaves * kRoomLeaves; ++value) {
    const auto one = sight.link(value, 0, 4), other = sight.link(value, 1, 4);
    ASSERT_TRUE(one && other);
    const double should = expected(value, true), open = expected(value, false);
    half_lit += should > 0.05 * open && should < 0.95 * open ? 1 : 0;
    dark += should == 0.0 ? 1 : 0;
    if (should == 0.0) {
      EXPECT_EQ(*one, 0.0F) << value;
    }
    EXPECT_NEAR(*one, should, 0.06 * open) << value;  // a leaf crosses a fifth of the half shadow, by four places
    square += std::pow(0.5 * (*one + *other) - should, 2.0);
    differ += 0.25 * std::pow(*one - *other, 2.0);
    all += open * open;
  }
  EXPECT_GT(half_lit, 60U);
  EXPECT_GT(dark, 60U);
  EXPECT_LT(std::sqrt(square / all), 0.01);
  // What the halves differ by tells what their mean is off by: they are independent, of a hundred leaves.
  EXPECT_GT(differ, 0.5 * square);
  EXPECT_LT(differ, 2.0 * square);
}

TEST_F(LightSightTest, SaysNothingWherePlanesCut) {
  const LightSight sight(rays_, lamp_, 1);
  EXPECT_TRUE(sight.link(0, 0, 2));
  // The upper side of the screen sees all of it, and so does the floor; a wall through the lamp sees a part.
  std::vector<test::Quad> quads{{{0.0F, -0.4F, -0.4F}, {0.0F, 0.8F, 0.0F}, {0.0F, 0.0F, 0.8F}}};
  scene_ = test::makeQuadScene(quads);
  sides_ = makeSides(*scene_.patches);
  rays_ = std::make_shared<const LeafRays>(*scene_.patches, sides_);
  EXPECT_FALSE(LightSight(rays_, lamp_, 1).link(0, 0, 2));
  // And from behind it there is no lamp.
  for (auto& corner : lamp_.corners) corner.y = -0.45F;
  makeRoom(false);
  EXPECT_FALSE(LightSight(rays_, lamp_, 1).link(0, 0, 2));
}

}  // namespace
}  // namespace radiosity::solver
