// What is measured at the surface, against Lambert's formula and against lookups that are wrong by a known amount.
#include "server/solver/surface/surface_error.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>

#include "server/solver/math/polygon_form_factor.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

constexpr float kEmission = 5.0F;

/// A black floor, a lamp above its middle and, where it is asked for, a plate that hides the lamp from a part of it.
class SurfaceErrorTest : public testing::Test {
 protected:
  explicit SurfaceErrorTest(bool has_plate = false) {
    test::Quad floor{{-0.5F, -0.4F, 0.5F}, {1.0F, 0.0F, 0.0F}, {0.0F, 0.0F, -1.0F}};
    floor.width = floor.height = 16;
    test::Quad lamp{{-0.1F, 0.4F, -0.1F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.0F, 0.2F}};
    lamp.width = lamp.height = 1;
    lamp.emission = glm::vec3(kEmission);
    std::vector<test::Quad> quads{floor, lamp};
    if (has_plate) {
      test::Quad plate{{-0.1F, 0.0F, -0.1F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.0F, 0.2F}};
      plate.width = plate.height = 1;
      quads.push_back(plate);
    }
    scene_ = test::makeQuadScene(quads);
    irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(0.0F));
  }

  [[nodiscard]] SolvedScene solved() const {
    return {*scene_.patches, nullptr, nullptr, scene_.materials, sources_, irradiance_};
  }
  [[nodiscard]] PlaceLight light() const { return PlaceLight(solved()); }

  /// Of the floor, as if nothing hid the lamp.
  [[nodiscard]] static double litAt(const glm::dvec3& at) {
    const std::array<glm::vec3, 4> corners{
        glm::vec3(-0.1F, 0.4F, -0.1F), {0.1F, 0.4F, -0.1F}, {0.1F, 0.4F, 0.1F}, {-0.1F, 0.4F, 0.1F}};
    return static_cast<double>(kEmission) * polygonFormFactor(at, {0, 1, 0}, corners);
  }

  /// Stated for lookups that find `factor` times the light that there is, on the floor; elsewhere none arrives. In
  /// columns from `from` to `to` alone, if they are given.
  [[nodiscard]] SurfaceErrorParts statedFor(float factor, double slice = 1e9, float from = 0.0F,
                                            float to = 16.0F) const {
    SurfaceError error(solved(), 1, 512);
    std::vector<glm::vec3> found;
    for (const auto& at : error.lookups()) {
      const glm::dvec3 place(-0.5 + static_cast<double>(at.texel.x) / 16.0, -0.4,
                             0.5 - static_cast<double>(at.texel.y) / 16.0);
      const bool is_off = at.texel.x >= from && at.texel.x < to;
      found.emplace_back(at.surface == 0 && at.side == 0 ? (is_off ? factor : 1.0F) * static_cast<float>(litAt(place))
                                                         : 0.0F);
    }
    error.take(std::move(found));
    while (!error.advance(slice)) continue;
    return error.stated();
  }

  test::QuadScene scene_;
  std::vector<glm::vec3> irradiance_;
  LightSources sources_;
};

class SurfaceErrorUnderAPlate : public SurfaceErrorTest {
 protected:
  SurfaceErrorUnderAPlate() : SurfaceErrorTest(true) {}

  /// Of the lamp, by what it brings there: an integral over it.
  [[nodiscard]] static double openPart(const glm::dvec3& from) {
    constexpr int kGrid = 300;
    double open = 0.0, all = 0.0;
    for (int i = 0; i < kGrid; ++i) {
      for (int k = 0; k < kGrid; ++k) {
        const glm::dvec3 point(-0.1 + 0.2 * (i + 0.5) / kGrid, 0.4, -0.1 + 0.2 * (k + 0.5) / kGrid);
        const auto way = point - from;
        const double square = glm::dot(way, way), weight = way.y * way.y / (square * square);
        const auto at = from + way * (-from.y / way.y);
        all += weight;
        if (std::abs(at.x) > 0.1 || std::abs(at.z) > 0.1) open += weight;
      }
    }
    return open / all;
  }
};

TEST_F(SurfaceErrorTest, APlaceThatSeesAllOfALampHasTheLightOfLambertsFormula) {
  const auto places = light();
  for (const auto value : {0U, 37U, 136U, 255U}) {
    const auto spot = places.spotOn(value, {0.3F, 0.6F});
    const auto arrives = places.arriving(spot, 7);
    EXPECT_NEAR(arrives.x, litAt(spot.place.position), 1e-5) << value;
    EXPECT_EQ(arrives.x, arrives.z);
  }
}

// The light is known exactly here, so that what is stated is the factor, but for the rounding of positions.
TEST_F(SurfaceErrorTest, WhatLookupsAreOffByIsStated) {
  EXPECT_NEAR(statedFor(1.1F).total, 0.1, 1e-3);
  EXPECT_NEAR(statedFor(1.1F).p95, 0.1, 1e-3);
  EXPECT_NEAR(statedFor(0.7F).total, 0.3, 1e-3);
  EXPECT_LT(statedFor(1.0F).total, 1e-3);
  EXPECT_LT(statedFor(1.0F).p95, 1e-3);
}

// More places lie where light changes from leaf to leaf, and each of them counts for less.
TEST_F(SurfaceErrorTest, WherePlacesLieChangesNothingThatIsStated) {
  for (std::uint32_t leaf = 0; leaf < 256; ++leaf) irradiance_[leaf] = glm::vec3(leaf % 16 == 3 ? 100.0F : 0.0F);
  // Of the light's square, by a grid over the floor, the part that the columns have.
  double all = 0.0, off = 0.0;
  for (int i = 0; i < 160 * 160; ++i) {
    const double x = (i % 160 + 0.5) / 160.0, y = (i / 160 + 0.5) / 160.0, light = litAt({x - 0.5, -0.4, y - 0.5});
    all += light * light;
    off += 16.0 * x >= 2.0 && 16.0 * x < 8.0 ? light * light : 0.0;
  }
  EXPECT_NEAR(statedFor(1.5F, 1e9, 2.0F, 8.0F).total, 0.5 * std::sqrt(off / all), 0.02);
  EXPECT_NEAR(statedFor(1.5F, 1e9, 2.0F, 8.0F).p95, 0.5, 1e-3);
  EXPECT_LT(statedFor(1.5F, 1e9, 2.0F, 2.5F).p95, 1e-3) << "half a column is three hundredths of the floor";
  SurfaceError error(solved(), 1, 512);
  error.take(std::vector<glm::vec3>(error.lookups().size()));
  while (!error.advance(1e9)) continue;
  std::size_t in_stripe = 0;
  double area = 0.0;
  for (const auto& at : error.lookups())
    in_stripe += at.surface == 0 && at.texel.x >= 2.0F && at.texel.x < 5.0F ? 1 : 0;
  for (const auto& place : error.measured()) area += place.area;
  EXPECT_GT(in_stripe, 200U);
  EXPECT_NEAR(area, 1.04, 0.02);  // of the floor and the lamp, by chance
}

TEST_F(SurfaceErrorTest, WhereTheCutsLieChangesNoBit) {
  const auto whole = statedFor(1.1F), sliced = statedFor(1.1F, 0.0);
  EXPECT_EQ(whole.total, sliced.total);
  EXPECT_EQ(whole.p95, sliced.p95);
  EXPECT_EQ(whole.deviation, sliced.deviation);
}

// A round more has places of its own, and what is measured stands for the same area.
TEST_F(SurfaceErrorUnderAPlate, MorePlacesTellMoreSurely) {
  constexpr std::size_t kFew = 16;
  const auto measure = [&](bool hurries) {
    auto error = std::make_unique<SurfaceError>(solved(), 1, kFew);
    std::vector<glm::vec3> found;  // as if there was no plate: few places lie in its shadow, and all that is wrong
    for (const auto& at : error->lookups()) {
      const glm::dvec3 place(-0.5 + static_cast<double>(at.texel.x) / 16.0, -0.4,
                             0.5 - static_cast<double>(at.texel.y) / 16.0);
      found.emplace_back(at.surface == 0 && at.side == 0 ? static_cast<float>(litAt(place)) : 0.0F);
    }
    error->take(std::move(found));
    error->setWantedDeviation(0.0);
    if (hurries) error->hurry();
    while (!error->advance(1e9)) continue;
    return error;
  };
  const auto few = measure(true), many = measure(false);
  EXPECT_EQ(few->stated().places, kFew);
  EXPECT_GT(many->stated().places, 2 * kFew);
  EXPECT_LT(many->stated().deviation, 0.7 * few->stated().deviation);
  EXPECT_NEAR(many->stated().total, few->stated().total, 3.0 * few->stated().deviation);
  const auto areaOf = [](const SurfaceError& error) {
    double area = 0.0;
    for (const auto& place : error.measured()) area += place.area;
    return area;
  };
  EXPECT_NEAR(areaOf(*many) / areaOf(*few), 1.0, 0.1);
}

// Lookups that know nothing of the plate are wrong in its shadow alone, and there by all of the light.
TEST_F(SurfaceErrorUnderAPlate, AShadowThatLookupsMissIsStated) {
  const auto stated = statedFor(1.0F);
  EXPECT_GT(stated.total, 0.3);
  EXPECT_GT(stated.p95, 0.5);
}

// In penumbra the truth is an estimate, and what that is off by is not the lookups'.
TEST_F(SurfaceErrorUnderAPlate, WhatTheTruthIsOffByIsNotStated) {
  SurfaceError error(solved(), 1, 512);
  std::vector<glm::vec3> found;
  for (const auto& at : error.lookups()) {
    const glm::dvec3 place(-0.5 + static_cast<double>(at.texel.x) / 16.0, -0.4,
                           0.5 - static_cast<double>(at.texel.y) / 16.0);
    const bool is_lit = at.surface == 0 && at.side == 0;
    found.emplace_back(is_lit ? static_cast<float>(litAt(place) * openPart(place)) : 0.0F);
  }
  error.take(std::move(found));
  error.setWantedDeviation(3e-3);
  while (!error.advance(1e9)) continue;
  EXPECT_LT(error.stated().total, 0.01);
  EXPECT_LT(error.stated().p95, 0.03);
}

TEST_F(SurfaceErrorUnderAPlate, UnderItThereIsNoLight) {
  const auto places = light();
  EXPECT_EQ(places.arriving(places.spotOn(8 * 16 + 8, {0.5F, 0.5F}), 3).x, 0.0);
}

// A lamp that is hidden in part is seen by points of it: the mean of many estimates is the part that is open, near the
// edges of the penumbra too, where most first looks agree. 4096 of some 30 points each tell it to half a percent.
TEST_F(SurfaceErrorUnderAPlate, InPenumbraThePartThatIsOpenCounts) {
  const auto places = light();
  std::size_t nearly_open = 0, nearly_hidden = 0;
  for (int i = 0; i < 18; ++i) {
    const auto spot = places.spotOn(8 * 16 + 2 + static_cast<std::uint32_t>(i / 3), {0.1F + 0.4F * (i % 3), 0.5F});
    const auto from = spot.place.position;
    double mean = 0.0;
    constexpr std::uint64_t kKeys = 4096;
    for (std::uint64_t key = 0; key < kKeys; ++key)
      mean += places.arriving(spot, key * 7919).x / static_cast<double>(kKeys);
    const double part = openPart(from);
    nearly_open += part > 0.8 && part < 1.0 ? 1 : 0;
    nearly_hidden += part > 0.0 && part < 0.2 ? 1 : 0;
    EXPECT_NEAR(mean, litAt(from) * part, 0.005 * litAt(from)) << i << ", open: " << part;
  }
  EXPECT_GT(nearly_open, 0U);
  EXPECT_GT(nearly_hidden, 0U);
}

// A leak into the dark is no small thing beside nothing.
TEST_F(SurfaceErrorTest, LightWhereThereIsNoneIsAllWrong) {
  scene_.materials.emission.fill(glm::vec3(0.0F));
  EXPECT_EQ(statedFor(1.0F).total, 1.0);
  EXPECT_EQ(statedFor(1.0F).p95, 1.0);
}

TEST_F(SurfaceErrorTest, WithoutLightNothingIsStated) {
  scene_.materials.emission.fill(glm::vec3(0.0F));
  const auto stated = statedFor(0.0F);
  EXPECT_EQ(stated.total, 0.0);
  EXPECT_EQ(stated.p95, 0.0);
}

}  // namespace
}  // namespace radiosity::solver
