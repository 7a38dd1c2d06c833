// Light from leaves that are far brighter than the rest, against Lambert's formula.
#include "server/solver/surface/place_light.h"

#include <gtest/gtest.h>

#include <cmath>

#include "server/solver/math/polygon_form_factor.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

constexpr std::uint32_t kAcross = 4;

/// A black floor and, 0.8 above it, a small plate that faces down and reflects light, from leaf to leaf more. With
/// `sheet`, a part of the way is taken by a black one.
class BrightPlate : public testing::Test {
 protected:
  explicit BrightPlate(bool sheet = false) {
    test::Quad floor{{-0.5F, -0.4F, 0.5F}, {1.0F, 0.0F, 0.0F}, {0.0F, 0.0F, -1.0F}};
    test::Quad plate{{-0.1F, 0.4F, -0.1F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.0F, 0.2F}};
    plate.width = plate.height = kAcross;
    plate.reflectance = glm::vec3(0.5F);
    std::vector<test::Quad> quads{floor, plate};
    if (sheet) quads.push_back({{-0.5F, 0.0F, -0.5F}, {0.5F, 0.0F, 0.0F}, {0.0F, 0.0F, 1.0F}});
    scene_ = test::makeQuadScene(quads);
    auto sides = makeSides(*scene_.patches);
    irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(0.0F));
    for (std::uint32_t leaf = 0; leaf < kAcross * kAcross; ++leaf)
      irradiance_[sides[1].first_node + leaf] = 2.0F * brightness(leaf);
    light_.emplace(SolvedScene{*scene_.patches, nullptr, nullptr, scene_.materials, sources_, irradiance_});
  }

  static glm::vec3 brightness(std::uint32_t leaf) {
    return glm::vec3(100.0F, 50.0F, 25.0F) * static_cast<float>(1 + leaf);
  }

  /// As if nothing lay between.
  [[nodiscard]] static glm::dvec3 exact(const glm::dvec3& at, const glm::dvec3& normal) {
    glm::dvec3 sum(0.0);
    constexpr float kWide = 0.2F / kAcross;
    for (std::uint32_t leaf = 0; leaf < kAcross * kAcross; ++leaf) {
      const float x = -0.1F + kWide * static_cast<float>(leaf % kAcross);
      const float z = -0.1F + kWide * static_cast<float>(leaf / kAcross);
      const std::array<glm::vec3, 4> corners{
          glm::vec3(x, 0.4F, z), {x + kWide, 0.4F, z}, {x + kWide, 0.4F, z + kWide}, {x, 0.4F, z + kWide}};
      sum += polygonFormFactor(at, normal, corners) * glm::dvec3(brightness(leaf));
    }
    return sum;
  }

  struct Estimates {
    glm::dvec3 mean{0.0};
    double spread = 0.0;  ///< standard deviation of one, relative
  };
  [[nodiscard]] Estimates estimates(const PlaceLight::Spot& spot) const {
    constexpr std::uint64_t kCount = 200;
    Estimates all;
    double squares = 0.0;
    for (std::uint64_t key = 0; key < kCount; ++key) {
      const auto arrives = light_->arriving(spot, 1000 + key);
      all.mean += arrives / static_cast<double>(kCount);
      squares += arrives.x * arrives.x / static_cast<double>(kCount);
    }
    all.spread = all.mean.x > 0.0 ? std::sqrt(std::max(0.0, squares / (all.mean.x * all.mean.x) - 1.0)) : 0.0;
    return all;
  }

  test::QuadScene scene_;
  std::vector<glm::vec3> irradiance_;
  LightSources sources_;
  std::optional<PlaceLight> light_;
};

class BrightPlateBehindASheet : public BrightPlate {
 protected:
  BrightPlateBehindASheet() : BrightPlate(true) {}
};

// Rays alone, of which one in fifty meets the plate, are off by 60 %.
TEST_F(BrightPlate, IsFoundFromAfar) {
  const auto spot = PlaceLight::spotAt({0.1, -0.4, 0.05}, {0.0, 1.0, 0.0});
  const auto found = estimates(spot);
  const auto expected = exact(spot.place.position, spot.place.normal);
  EXPECT_NEAR(found.mean.x / expected.x, 1.0, 0.01);
  EXPECT_NEAR(found.mean.z / expected.z, 1.0, 0.01);
  EXPECT_LT(found.spread, 0.1);
}

// Places of a plate that is near are far too unlike each other to be looked for one by one: rays find it.
TEST_F(BrightPlate, IsFoundFromNearby) {
  for (const double gap : {0.2, 0.02, 0.002}) {
    const auto spot = PlaceLight::spotAt({0.07, 0.4 - gap, -0.03}, {0.0, 1.0, 0.0});
    const auto found = estimates(spot);
    EXPECT_NEAR(found.mean.x / exact(spot.place.position, spot.place.normal).x, 1.0, 0.01) << gap;
    EXPECT_LT(found.spread, 0.12) << gap;
  }
}

TEST_F(BrightPlate, CountsByTheShadingNormal) {
  auto spot = PlaceLight::spotAt({0.1, 0.0, 0.05}, {0.0, 1.0, 0.0});
  spot.shading = glm::normalize(glm::dvec3(0.5, 1.0, 0.2));
  EXPECT_NEAR(estimates(spot).mean.x / exact(spot.place.position, spot.shading).x, 1.0, 0.01);
}

TEST_F(BrightPlate, CountsByTheCosinesOfEitherEnd) {
  for (const auto& normal : {glm::dvec3(0.6, 0.8, 0.0), glm::dvec3(-0.3, 0.2, 0.5)}) {
    const auto spot = PlaceLight::spotAt({0.1, 0.0, -0.3}, glm::normalize(normal));
    EXPECT_NEAR(estimates(spot).mean.x / exact(spot.place.position, spot.place.normal).x, 1.0, 0.01) << normal.x;
  }
}

// Places there are drawn where rays pass, too, so that rays alone find what such leaves send.
TEST_F(BrightPlate, IsNotLookedForWhereOneCanSeeThroughIt) {
  auto& patches = *scene_.patches;
  const auto sides = makeSides(patches);
  std::vector<glm::vec3> radiosity(sides.back().first_value + sides.back().leaf_count);
  radiosity[sides[1].first_value + 5] = glm::vec3(100.0F);
  const auto find = [&] { return BrightLeaves::find(patches, LeafRays(patches, sides), radiosity, nullptr); };
  const auto found = find();
  ASSERT_TRUE(found);
  EXPECT_NEAR(found->density(sides[1].first_value + 5), 1.0 / LeafRays(patches, sides).areaOf(sides[1].first_value + 5),
              1e-3);
  EXPECT_EQ(found->density(sides[1].first_value + 6), 0.0);
  patches.surfaces[sides[1].surface].see_through = true;
  EXPECT_FALSE(find());
}

TEST_F(BrightPlate, IsTheSameForTheSameKey) {
  const auto spot = PlaceLight::spotAt({0.1, -0.4, 0.05}, {0.0, 1.0, 0.0});
  EXPECT_EQ(light_->arriving(spot, 5), light_->arriving(spot, 5));
  EXPECT_NE(light_->arriving(spot, 5), light_->arriving(spot, 6));
}

TEST_F(BrightPlate, BringsNothingToWhatFacesAway) {
  EXPECT_EQ(estimates(PlaceLight::spotAt({0.1, 0.0, 0.05}, {0.0, -1.0, 0.0})).mean.x, 0.0);
}

// The sheet takes the left half of the room: places far to the left are in its shadow, those far to the right are not.
TEST_F(BrightPlateBehindASheet, IsNotSeenThroughIt) {
  EXPECT_EQ(estimates(PlaceLight::spotAt({-0.45, -0.4, 0.05}, {0.0, 1.0, 0.0})).mean.x, 0.0);
  const glm::dvec3 right(0.45, -0.4, 0.05);
  EXPECT_NEAR(estimates(PlaceLight::spotAt(right, {0.0, 1.0, 0.0})).mean.x / exact(right, {0.0, 1.0, 0.0}).x, 1.0,
              0.015);
}

}  // namespace
}  // namespace radiosity::solver
