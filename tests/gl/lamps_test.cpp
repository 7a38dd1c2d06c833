// Lamps with a size or a web at leaves: closed forms where nothing stands between, half shadows, energy.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/gpu/workers/gpu_transport.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/math/lamp_form_factor.h"
#include "server/solver/math/polygon_form_factor.h"
#include "tests/gl/both_sights.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

using scene::LightKind;
using std::numbers::pi;

constexpr std::uint32_t kTexels = 16;

scene::PunctualLight lampOf(LightKind kind, const glm::dvec2& half, const glm::dvec3& at = {0.1, -0.2, 0.3}) {
  scene::PunctualLight light;
  light.kind = kind;
  light.position = at;
  light.direction = {0, 0, -1};
  light.intensity = glm::vec3(3.0F, 0.5F, 0.0F);
  light.half = half;
  return light;
}

scene::SharedWeb webOf(const std::vector<float>& polar, const std::vector<float>& candela) {
  return scene::SharedWeb(std::make_shared<const scene::LightWeb>(scene::LightWeb::of(polar, {0.0F}, candela)));
}

/// Candela 1000 cos(polar) below, in steps of a degree: interpolated it is off by 4e-5 at most.
scene::SharedWeb cosineWeb() {
  std::vector<float> polar, candela;
  for (int i = 0; i <= 90; ++i) {
    polar.push_back(static_cast<float>(i));
    candela.push_back(static_cast<float>(1000.0 * std::cos(i * pi / 180.0)));
  }
  return webOf(polar, candela);
}

class Lamps : public BothSights {
 protected:
  /// What the light brings in so many rounds, as their mean.
  void light(const scene::PunctualLight& light, std::uint32_t rounds = 1) {
    scene_ = builder_.build();
    ASSERT_TRUE(transport_->setScene(scene_).has_value());
    flux_ = accumulators(*scene_);
    rounds_ = rounds;
    solver::PunctualLights lights(*scene_, {{light}, {}}, {});
    emitted_ = lights.flux()[0];
    while (lights.hasSlice(rounds)) {
      solver::ShotBatch batch;
      batch.flux_scale = kFluxScale;
      lights.addSlice(rounds, batch);
      const auto done = transport_->run(batch, flux_);
      ASSERT_TRUE(done.has_value()) << done.error().text();
    }
  }
  [[nodiscard]] double irradiance(std::uint32_t surface, std::uint32_t x, std::uint32_t y) const {
    const auto& chart = scene_->surfaces[surface];
    const auto id = chart.first_node[0] + y * chart.width + x;
    return static_cast<double>(flux_.node[0][id][0] + flux_.node[1][id][0]) / kFluxScale / rounds_ /
           static_cast<double>(scene_->node_area[id]);
  }
  /// A floor at z = -1/2 that looks up.
  std::uint32_t addFloor() { return builder_.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, kTexels, kTexels}); }

  /// Largest relative difference from a formula of places on the floor, each leaf's mean by 8 x 8 points.
  template <typename Formula>
  [[nodiscard]] double worst(std::uint32_t floor, const Formula& formula) const {
    double most = 0.0;
    for (std::uint32_t y = 0; y < kTexels; ++y) {
      for (std::uint32_t x = 0; x < kTexels; ++x) {
        double exact = 0.0;
        for (int k = 0; k < 64; ++k)
          exact += formula(glm::dvec3(-0.5 + (x + (k % 8 + 0.5) / 8) / kTexels,
                                      -0.5 + (y + (k / 8 + 0.5) / 8) / kTexels, -0.5)) /
                   64.0;
        if (exact > 0.0) most = std::max(most, std::abs(irradiance(floor, x, y) / exact - 1.0));
      }
    }
    return most;
  }
  void expectBalance(double tolerance) const {
    const auto all = flux_.gathered[0] + flux_.escaped[0] + flux_.backface[0];
    EXPECT_NEAR(static_cast<double>(all) / kFluxScale / rounds_ / emitted_, 1.0, tolerance);
  }

  SceneBuilder builder_;
  std::shared_ptr<const scene::PatchScene> scene_;
  solver::FluxAccumulators flux_;
  double emitted_ = 0.0;
  std::uint32_t rounds_ = 1;
};

// Leaves look from eight places at a time: their mean differs from that of 64 by as much as light varies in them.
constexpr double kEightPlaces = 2e-3;

TEST_P(Lamps, ARectangleOverAPlaneIsItsFormFactor) {
  const auto floor = addFloor();
  light(lampOf(LightKind::kRectangle, {0.2, 0.1}));
  const std::array<glm::vec3, 4> corners{
      {{-0.1F, -0.3F, 0.3F}, {-0.1F, -0.1F, 0.3F}, {0.3F, -0.1F, 0.3F}, {0.3F, -0.3F, 0.3F}}};
  EXPECT_LT(worst(floor,
                  [&](const glm::dvec3& at) {
                    return 3.0 * pi * solver::polygonFormFactor(at, {0, 0, 1}, corners);
                  }),
            kEightPlaces);
  EXPECT_NEAR(emitted_, 3.0 * pi * 0.08, 1e-6);
  expectBalance(0.01);
}

TEST_P(Lamps, ADiscOverAPlaneIsItsFormFactor) {
  const auto floor = addFloor();
  light(lampOf(LightKind::kDisc, {0.25, 0.25}));
  EXPECT_LT(worst(floor,
                  [](const glm::dvec3& at) {
                    return 3.0 * pi * solver::discFormFactor(at, {0, 0, 1}, {0.1, -0.2, 0.3}, {0, 0, -1}, 0.25);
                  }),
            kEightPlaces);
  EXPECT_NEAR(emitted_, 3.0 * pi * pi * 0.0625, 1e-6);
  expectBalance(0.01);
}

TEST_P(Lamps, ABallOutsideIsAPointOfItsFlux) {
  const auto floor = addFloor();
  light(lampOf(LightKind::kPoint, {0.15, 0.0}));
  EXPECT_LT(worst(floor,
                  [](const glm::dvec3& at) {
                    const auto d = glm::dvec3(0.1, -0.2, 0.3) - at;
                    return 3.0 * d.z / std::pow(glm::length(d), 3.0);
                  }),
            kEightPlaces);
  EXPECT_NEAR(emitted_, 12.0 * pi, 1e-5);
  expectBalance(0.01);
}

TEST_P(Lamps, ASmallSpotIsASpot) {
  const auto floor = addFloor();
  auto spot = lampOf(LightKind::kSpot, {0.01, 0.0});
  spot.inner_cone_rad = 0.2;
  spot.outer_cone_rad = 0.9;
  light(spot);
  const double inner = std::cos(0.2), outer = std::cos(0.9);
  const double exact = 3.0 / 0.64;
  const auto x = static_cast<std::uint32_t>(0.6 * kTexels), y = static_cast<std::uint32_t>(0.3 * kTexels);
  EXPECT_NEAR(irradiance(floor, x, y), exact, 0.02 * exact) << "right below";
  EXPECT_NEAR(emitted_, 3.0 * 2.0 * pi * ((inner - outer) / 3.0 + 1.0 - inner), 1e-3);
  expectBalance(0.01);
}

TEST_P(Lamps, AWebThatIsTheSameAllAroundIsAPointLight) {
  const auto floor = addFloor();
  auto lamp = lampOf(LightKind::kWeb, {});
  lamp.web = webOf({0.0F, 90.0F, 180.0F}, {7.0F, 7.0F, 7.0F});
  light(lamp);
  EXPECT_LT(worst(floor,
                  [](const glm::dvec3& at) {
                    const auto d = glm::dvec3(0.1, -0.2, 0.3) - at;
                    return 21.0 * d.z / std::pow(glm::length(d), 3.0);
                  }),
            kEightPlaces);
  EXPECT_NEAR(emitted_, 21.0 * 4.0 * pi, 1e-3);
  expectBalance(0.01);
}

TEST_P(Lamps, AWebOfCosinesIsASmallDisc) {
  const auto floor = addFloor();
  auto lamp = lampOf(LightKind::kWeb, {});
  lamp.web = cosineWeb();
  light(lamp);
  const double area = pi * 1e-4;
  EXPECT_LT(
      worst(floor,
            [&](const glm::dvec3& at) {
              return 3000.0 / area * pi * solver::discFormFactor(at, {0, 0, 1}, {0.1, -0.2, 0.3}, {0, 0, -1}, 0.01);
            }),
      kEightPlaces);
}

TEST_P(Lamps, ABeamOfFiveDegreesIsNeitherLostNorNoisy) {
  constexpr std::uint32_t kFine = 128;
  const auto floor = builder_.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, kFine, kFine});
  std::vector<float> polar, candela;
  for (int i = 0; i <= 180; ++i) {
    polar.push_back(static_cast<float>(i));
    candela.push_back(i <= 2 ? 1000.0F : 0.0F);  // even within 2 degrees, none from 3 on
  }
  auto lamp = lampOf(LightKind::kWeb, {}, {0.1, -0.2, 0.3});
  lamp.web = webOf(polar, candela);
  light(lamp);
  for (const double away : {0.0, 1.0, 1.7, 3.5}) {  // degrees
    const glm::dvec3 at(0.1 + 0.8 * std::tan(away * pi / 180.0), -0.2, -0.5);
    const auto x = static_cast<std::uint32_t>((at.x + 0.5) * kFine);
    const auto way = glm::dvec3(lamp.position) - glm::dvec3((x + 0.5) / kFine - 0.5, 38.5 / kFine - 0.5, -0.5);
    const double exact = away < 3.0 ? 3000.0 * way.z / std::pow(glm::length(way), 3.0) : 0.0;
    EXPECT_NEAR(irradiance(floor, x, 38), exact, kEightPlaces * exact) << away;
  }
  // A beam that the floor's edge cuts in half: of 16,384 rays all around eleven would tell how much of it is lost.
  lamp.position = {0.5, 0.0, 0.3};
  light(lamp, 4);
  expectBalance(0.01);
  EXPECT_NEAR(static_cast<double>(flux_.escaped[0]) / kFluxScale / 4.0 / emitted_, 0.5, 0.01);
}

TEST_P(Lamps, AClosedBoxReceivesAllThatALampEmits) {
  builder_.addBox(glm::vec3(-0.5F), glm::vec3(0.5F), kTexels, true);
  auto web = lampOf(LightKind::kWeb, {});
  web.web = cosineWeb();
  auto spot = lampOf(LightKind::kSpot, {0.05, 0.0});
  spot.inner_cone_rad = 0.5;
  spot.outer_cone_rad = 1.0;
  for (const auto& lamp : {lampOf(LightKind::kRectangle, {0.2, 0.1}), lampOf(LightKind::kDisc, {0.1, 0.1}),
                           lampOf(LightKind::kPoint, {0.1, 0.0}), web, spot}) {
    light(lamp, 4);
    EXPECT_NEAR(static_cast<double>(flux_.gathered[0]) / kFluxScale / 4.0 / emitted_, 1.0, 3e-3)
        << static_cast<int>(lamp.kind);
  }
}

TEST_P(Lamps, ALampFlushWithACeilingLightsTheFloorAndNotTheCeiling) {
  const auto floor = addFloor();
  const auto ceiling = builder_.add({{-0.5F, -0.5F, 0.5F}, {0, 1, 0}, {1, 0, 0}, kTexels, kTexels});
  light(lampOf(LightKind::kRectangle, {0.2, 0.2}, {0.0, 0.0, 0.5}));
  const std::array<glm::vec3, 4> corners{
      {{-0.2F, -0.2F, 0.5F}, {-0.2F, 0.2F, 0.5F}, {0.2F, 0.2F, 0.5F}, {0.2F, -0.2F, 0.5F}}};
  EXPECT_LT(worst(floor,
                  [&](const glm::dvec3& at) {
                    return 3.0 * pi * solver::polygonFormFactor(at, {0, 0, 1}, corners);
                  }),
            kEightPlaces);
  for (std::uint32_t x = 0; x < kTexels; ++x) EXPECT_EQ(irradiance(ceiling, x, 8), 0.0);
}

TEST_P(Lamps, BehindAnEdgeTheLightIsThatOfThePartWhichIsSeen) {
  const auto floor = addFloor();
  // A screen half way up that covers all with x > 0.
  (void)builder_.add({{0.0F, -0.6F, 0.0F}, {0.6F, 0, 0}, {0, 1.2F, 0}, 1, 1, true});
  const auto lamp = lampOf(LightKind::kDisc, {0.2, 0.2}, {0.0, 0.0, 0.4});
  light(lamp, 64);
  for (std::uint32_t x = 0; x < kTexels; ++x) {
    // By points of the leaf and of the disc.
    double exact = 0.0;
    std::uint32_t k = 0;
    for (double px = -0.5 + (x + 1.0 / 16) / kTexels; k < 8; ++k, px += 1.0 / 8 / kTexels) {
      for (int i = 0; i < 40; ++i) {
        for (int j = 0; j < 160; ++j) {
          const double r = 0.2 * std::sqrt((i + 0.5) / 40), angle = 2.0 * pi * (j + 0.5) / 160;
          const glm::dvec3 way(r * std::cos(angle) - px, r * std::sin(angle) - 0.03125, 0.9);
          if (px + way.x * 0.5 / 0.9 > 0.0) continue;
          exact += 3.0 * pi * 0.04 * 0.9 * 0.9 / std::pow(glm::dot(way, way), 2.0) / (8 * 40 * 160);
        }
      }
    }
    EXPECT_NEAR(irradiance(floor, x, 8), exact, 0.02 * exact + 0.003) << x;
  }
}

TEST_P(Lamps, WhatIsTakenBackLeavesNothing) {
  const auto floor = addFloor();
  (void)builder_.add({{0.0F, -0.6F, 0.0F}, {0.6F, 0, 0}, {0, 1.2F, 0}, 1, 1, true});
  scene_ = builder_.build();
  ASSERT_TRUE(transport_->setScene(scene_).has_value());
  flux_ = accumulators(*scene_);
  solver::PunctualLights lights(*scene_, {{lampOf(LightKind::kDisc, {0.2, 0.2})}, {}}, {});
  for (const bool dark : {false, true}) {
    if (dark) lights.setSources(*scene_, {});
    while (lights.hasSlice(2)) {
      solver::ShotBatch batch;
      batch.flux_scale = kFluxScale;
      lights.addSlice(2, batch);
      ASSERT_TRUE(transport_->run(batch, flux_).has_value());
    }
  }
  for (std::uint32_t x = 0; x < kTexels; ++x) EXPECT_EQ(irradiance(floor, x, 8), 0.0);
}

TEST_P(Lamps, AWebThatDoesNotFitItsBatchIsRefused) {
  addFloor();
  scene_ = builder_.build();
  ASSERT_TRUE(transport_->setScene(scene_).has_value());
  flux_ = accumulators(*scene_);
  solver::ShotBatch batch;
  solver::LampShot shot;
  shot.shape.kind = solver::LampShape::Kind::kWeb;
  shot.web_size = 10;
  batch.webs = {3.0F, 1.0F, 0.0F, 90.0F, 180.0F, 0.0F, 1.0F, 1.0F, 1.0F};
  batch.lamps = {shot};
  EXPECT_FALSE(transport_->run(batch, flux_).has_value()) << "beyond the end";
  batch.lamps[0].web_size = 8;
  EXPECT_FALSE(transport_->run(batch, flux_).has_value()) << "shorter than its counts say";
  batch.lamps[0].web_size = 9;
  EXPECT_TRUE(transport_->run(batch, flux_).has_value());
}

INSTANTIATE_TEST_SUITE_P(Sights, Lamps, kBothSights, nameOfSight);

}  // namespace
}  // namespace radiosity::test
