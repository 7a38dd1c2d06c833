// Lights without extent, gathered: closed forms of irradiance, exact shadows, energy, and what surfaces let through.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <random>

#include "server/gpu/workers/gpu_transport.h"
#include "server/scene/burial/coverage.h"
#include "server/solver/lamps/punctual_lights.h"
#include "tests/gl/both_sights.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

using std::numbers::pi;

/// One receiving point, in the middle of the leaf, so that closed forms can be compared point by point.
solver::ReceiverPoints middle() {
  solver::ReceiverPoints points;
  points.at[0] = glm::vec2(0.5F);
  return points;
}

solver::PointShot downwardShot(const glm::vec3& origin) {
  solver::PointShot shot;
  shot.frame.origin = origin;
  shot.frame.normal = {0, 0, -1};
  shot.frame.tangent = {1, 0, 0};
  shot.intensity = {3.0, 0.5, 0.0};
  for (std::size_t c = 0; c < 3; ++c) shot.emitted[c] = 2.0 * pi * shot.intensity[c];
  shot.receivers = middle();
  return shot;
}

/// A floor at z = -1/2 that looks up, 16 x 16 leaves.
std::uint32_t addFloor(SceneBuilder& builder, std::uint32_t texels = 16) {
  return builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, texels, texels});
}

class Punctual : public BothSights {
 protected:
  solver::FluxAccumulators run(const std::shared_ptr<const scene::PatchScene>& scene, solver::ShotBatch batch) {
    batch.flux_scale = kFluxScale;
    EXPECT_TRUE(transport_->setScene(scene).has_value());
    auto flux = accumulators(*scene);
    const auto counters = transport_->run(batch, flux);
    EXPECT_TRUE(counters.has_value()) << counters.error().text();
    return flux;
  }
  /// All that the sources owe for one round.
  solver::FluxAccumulators runRound(const std::shared_ptr<const scene::PatchScene>& scene,
                                    const solver::LightSources& sources, std::uint32_t rounds = 1) {
    solver::PunctualLights lights(*scene, sources, {});
    solver::ShotBatch batch;
    while (lights.hasSlice(rounds)) {
      solver::ShotBatch slice;
      lights.addSlice(rounds, slice);
      append(slice, batch);
    }
    return run(scene, batch);
  }
  static void append(const solver::ShotBatch& slice, solver::ShotBatch& batch) {
    const auto first = static_cast<std::uint32_t>(batch.views.size());
    batch.point_lights.insert(batch.point_lights.end(), slice.point_lights.begin(), slice.point_lights.end());
    batch.views.insert(batch.views.end(), slice.views.begin(), slice.views.end());
    for (auto shot : slice.parallel) {
      shot.first_view += first;
      shot.first_of_sky += first;
      batch.parallel.push_back(shot);
    }
  }
};

/// Irradiance of leaf (x, y), channel 0, both halves.
double irradiance(const scene::PatchScene& scene, const solver::FluxAccumulators& flux, std::uint32_t surface,
                  std::uint32_t x, std::uint32_t y) {
  const auto& chart = scene.surfaces[surface];
  const auto id = chart.first_node[0] + y * chart.width + x;
  return static_cast<double>(flux.node[0][id][0] + flux.node[1][id][0]) / kFluxScale /
         static_cast<double>(scene.node_area[id]);
}

glm::dvec3 leafMiddle(std::uint32_t x, std::uint32_t y, std::uint32_t texels) {
  return {-0.5 + (x + 0.5) / texels, -0.5 + (y + 0.5) / texels, -0.5};
}

double total(const solver::FluxAccumulators& flux) {
  return static_cast<double>(flux.gathered[0] + flux.escaped[0] + flux.backface[0]) / kFluxScale;
}

TEST_P(Punctual, APointLightOverAPlaneGivesICosOverSquaredDistance) {
  SceneBuilder builder;
  const auto floor = addFloor(builder);
  const auto scene = builder.build();
  solver::ShotBatch batch;
  batch.point_lights = {downwardShot({0.1F, -0.2F, 0.3F})};
  const auto flux = run(scene, batch);
  for (std::uint32_t y = 0; y < 16; ++y) {
    for (std::uint32_t x = 0; x < 16; ++x) {
      const glm::dvec3 d = glm::dvec3(0.1, -0.2, 0.3) - leafMiddle(x, y, 16);
      const double exact = 3.0 * d.z / std::pow(glm::length(d), 3.0);
      EXPECT_NEAR(irradiance(*scene, flux, floor, x, y), exact, 1e-5 * exact) << x << ", " << y;
    }
  }
}

TEST_P(Punctual, ASpotFadesBetweenItsConesAsTheExtensionSays) {
  SceneBuilder builder;
  const auto floor = addFloor(builder);
  const auto scene = builder.build();
  const double inner = std::cos(0.2), outer = std::cos(0.6);
  auto shot = downwardShot({0.0F, 0.0F, 0.3F});
  shot.cone_scale = static_cast<float>(1.0 / (inner - outer));
  shot.cone_offset = static_cast<float>(-outer / (inner - outer));
  solver::ShotBatch batch;
  batch.point_lights = {shot};
  const auto flux = run(scene, batch);
  for (std::uint32_t y = 0; y < 16; ++y) {
    for (std::uint32_t x = 0; x < 16; ++x) {
      const glm::dvec3 d = glm::dvec3(0.0, 0.0, 0.3) - leafMiddle(x, y, 16);
      const double cosine = d.z / glm::length(d);
      const double fade = std::clamp((cosine - outer) / (inner - outer), 0.0, 1.0);
      const double exact = 3.0 * cosine / glm::dot(d, d) * fade * fade;
      // The cosine is rounded to 6e-8: near the outer cone that is all there is.
      EXPECT_NEAR(irradiance(*scene, flux, floor, x, y), exact, 1e-4 * exact + 1e-7) << x << ", " << y;
    }
  }
}

TEST_P(Punctual, RangeFadesTheLightAndNothingArrivesBeyondIt) {
  SceneBuilder builder;
  const auto floor = addFloor(builder);
  const auto scene = builder.build();
  auto shot = downwardShot({0.0F, 0.0F, 0.0F});
  shot.range = 0.7F;
  solver::ShotBatch batch;
  batch.point_lights = {shot};
  const auto flux = run(scene, batch);
  for (std::uint32_t x = 0; x < 16; ++x) {
    const glm::dvec3 d = -leafMiddle(x, 8, 16);
    const double distance = glm::length(d);
    const double window = std::clamp(1.0 - std::pow(distance / static_cast<double>(0.7F), 4.0), 0.0, 1.0);
    const double exact = 3.0 * d.z / std::pow(distance, 3.0) * window;
    EXPECT_NEAR(irradiance(*scene, flux, floor, x, 8), exact, 1e-4 * exact + 1e-9) << x;
  }
  // what fades on its way counts as escaped: all is accounted for, within the pixels of one image
  EXPECT_NEAR(total(flux) / shot.emitted[0], 1.0, 0.01);
}

TEST_P(Punctual, ALeafCloseToALightReceivesItsSolidAngle) {
  SceneBuilder builder;
  const auto floor = addFloor(builder, 4);
  const auto scene = builder.build();
  auto shot =
      downwardShot({0.125F, 0.125F, -0.49F});  // over the middle of leaf (2, 2), a twenty-fifth of its side away
  solver::ShotBatch batch;
  batch.point_lights = {shot};
  const auto flux = run(scene, batch);
  // solid angle of a square of half side a at height h above its middle: 4 asin(a^2 / (a^2 + h^2))
  const double a2 = 0.125 * 0.125, h2 = 0.01 * 0.01;
  const double exact = 3.0 * 4.0 * std::asin(a2 / (a2 + h2)) / (0.25 * 0.25);
  EXPECT_NEAR(irradiance(*scene, flux, floor, 2, 2), exact, 1e-3 * exact);
}

TEST_P(Punctual, AClosedBoxReceivesAllThatAPointLightEmits) {
  SceneBuilder builder;
  builder.addBox(glm::vec3(-0.5F), glm::vec3(0.5F), 16, true);
  const auto scene = builder.build();
  const solver::LightSources sources{{{.position = {0.2, 0.1, -0.1}, .intensity = {3.0F, 0.0F, 0.0F}}}, {}};
  const auto flux = runRound(scene, sources);
  const double emitted = 4.0 * pi * 3.0;
  // Receiving points are jittered: 32 points a leaf over the round, on which irradiance varies by tens of percent.
  EXPECT_NEAR(static_cast<double>(flux.gathered[0]) / kFluxScale, emitted, 0.01 * emitted);
  EXPECT_EQ(flux.escaped[0], 0);
  EXPECT_EQ(flux.backface[0], 0);
}

TEST_P(Punctual, ADirectionalLightGivesECosAndItsEnergyIsAccountedFor) {
  SceneBuilder builder;
  const auto floor = addFloor(builder);
  builder.add({{-0.1F, -0.1F, 0.0F}, {0, 0.2F, 0}, {0.2F, 0, 0}, 4, 4});  // looks down: its back absorbs
  const auto scene = builder.build();
  const glm::dvec3 way = glm::normalize(glm::dvec3(0.3, 0.1, -1.0));
  const solver::LightSources sources{
      {{.kind = scene::LightKind::kDirectional, .direction = way, .intensity = {5.0F, 0.0F, 0.0F}}}, {}};
  const auto flux = runRound(scene, sources);
  const double exact = 5.0 * -way.z;
  EXPECT_NEAR(irradiance(*scene, flux, floor, 1, 1), exact, 1e-5 * exact);
  // The shadow: 0.2 x 0.2 moved by (0.15, 0.05); its middle leaf is dark, and the floor lacks as much as the back took.
  EXPECT_EQ(irradiance(*scene, flux, floor, 10, 8), 0.0);
  EXPECT_NEAR(static_cast<double>(flux.backface[0]) / kFluxScale, 0.04 * exact, 0.01 * 0.04 * exact);
  EXPECT_NEAR(static_cast<double>(flux.gathered[0]) / kFluxScale, 0.96 * exact, 0.002 * exact);
  const double entered = 5.0 * solver::boxSilhouette(solver::sceneBox(*scene), glm::vec3(-way));
  EXPECT_NEAR(total(flux), entered, 0.002 * entered);
}

TEST_P(Punctual, AnOpenPlaneUnderTheSkyReceivesPiTimesItsRadiance) {
  SceneBuilder builder;
  const auto floor = builder.add({{-0.5F, -0.5F, 0.0F}, {0, 0, 0.5F}, {0.5F, 0, 0}, 4, 4});  // normal +Y
  const auto wall = builder.add({{0.4F, -0.5F, -0.5F}, {0, 0.2F, 0}, {0, 0, -0.2F}, 4, 4});  // normal -X: sees half
  const auto scene = builder.build();
  solver::LightSources sources;
  sources.sky = {glm::vec3(2.0F, 0, 0), glm::vec3(0.5F, 0, 0)};
  const auto flux = runRound(scene, sources);
  EXPECT_GT(scene->triangles[scene->surfaces[floor].first_triangle].normal.y, 0.99F);
  // The wall stands a little in the floor's sky, the floor in the wall's lower half: the leaves here are out of both.
  EXPECT_NEAR(irradiance(*scene, flux, floor, 0, 0), 2.0 * pi, 0.02 * 2.0 * pi);
  EXPECT_NEAR(irradiance(*scene, flux, wall, 0, 3), (2.0 + 0.5) * pi / 2.0, 0.02 * 2.5 * pi / 2.0);
}

TEST_P(Punctual, AConvexSolidUnderATwoColouredSkyReceivesTheHemisphereFormulaExactly) {
  SceneBuilder builder;
  const auto first = builder.addBox(glm::vec3(-0.3F), glm::vec3(0.3F), 4, false);
  const auto scene = builder.build();
  solver::LightSources sources;
  sources.sky = {glm::vec3(2.0F, 0, 0), glm::vec3(0.5F, 0, 0)};
  const auto flux = runRound(scene, sources);
  for (std::uint32_t face = 0; face < 6; ++face) {
    const double up = static_cast<double>(scene->triangles[scene->surfaces[first + face].first_triangle].normal.y);
    const double exact = pi * (2.0 * (1.0 + up) + 0.5 * (1.0 - up)) / 2.0;
    for (std::uint32_t leaf = 0; leaf < 16; ++leaf) {
      EXPECT_NEAR(irradiance(*scene, flux, first + face, leaf % 4, leaf / 4), exact, 1e-5 * exact) << "face " << face;
    }
  }
  // What enters the box enters the solid, which fills it.
  const double entered = 6.0 * 0.36 * pi * (2.0 + 0.5) / 2.0;
  EXPECT_NEAR(total(flux), entered, 0.01 * entered);
}

// Its own triangle sees nothing of the upper sky, and none of the directions that stand for it: 0 / 0, the light of one
// leaf was no number, and that of the whole scene neither.
TEST_P(Punctual, ALeafThatTurnsAwayFromTheSkyTakesWhatAnotherOfItsTrianglesSees) {
  SceneBuilder builder;
  const auto below = builder.add({{-0.1F, 0.0F, -0.1F}, {0.2F, 0, 0}, {0, 0, 0.2F}, 1, 1});
  const auto beside = builder.add({{0.1F, 0.0F, -0.1F}, {0, 0.2F, 0}, {0, 0, 0.2F}, 1, 1});
  const auto scene = std::make_shared<scene::PatchScene>(*builder.build());
  auto& surface = scene->surfaces[below];
  const auto own = surface.first_triangle, other = scene->surfaces[beside].first_triangle;
  ASSERT_EQ(scene->triangles[own].normal.y, -1.0F);
  ASSERT_EQ(scene->triangles[other].normal.y, 0.0F);
  surface.planar = false;
  auto& leaf = scene->leaves[surface.first_leaf];
  leaf.full = false;
  std::vector<scene::LeafSpots::Place> places;
  for (std::uint16_t i = 0; i < 64; ++i) places.push_back({i, i % 2 == 0 ? own : other});
  scene::LeafSpots::order(64, places);
  leaf.spot_list = scene->spots.add({glm::vec2(0.5F), glm::vec2(0.0F), 64}, places, false);
  solver::LightSources sources;
  sources.sky = {glm::vec3(1.0F), glm::vec3(0.0F)};
  const auto flux = runRound(scene, sources);
  // The wall's half of the places gets half of the upper sky. Each direction looks at one place of the leaf.
  EXPECT_NEAR(irradiance(*scene, flux, below, 0, 0), 0.5 * pi / 2.0, 0.25 * pi / 2.0);
}

TEST_P(Punctual, NothingLeaksIntoAClosedRoomAlongItsEdges) {
  SceneBuilder builder;
  builder.addBox(glm::vec3(-0.4F), glm::vec3(0.4F), 8, true);
  builder.add({{-1.0F, -0.401F, -1.0F}, {0, 0, 2}, {2, 0, 0}, 4, 4});  // the ground outside
  const auto scene = builder.build();
  solver::LightSources sources;
  sources.sky = {glm::vec3(1.0F), glm::vec3(1.0F)};
  sources.lights = {
      {.kind = scene::LightKind::kDirectional, .direction = {0.3, -0.8, 0.4}, .intensity = glm::vec3(1e5F)},
      {.position = {0.9, 0.9, 0.9}, .intensity = glm::vec3(1e5F)}};
  const auto flux = runRound(scene, sources);
  for (std::uint32_t surface = 0; surface < 6; ++surface) {
    for (std::uint32_t leaf = 0; leaf < 64; ++leaf) {
      EXPECT_EQ(irradiance(*scene, flux, surface, leaf % 8, leaf / 8), 0.0) << surface << ": " << leaf;
    }
  }
}

// A plate with a rim of facets narrower than pixels. Pixels blur the rim's shadow alike to both sides, but what falls
// inside is dark as it is, and the shadow was too small.
TEST_P(Punctual, TheShadowOfAPlateWithANarrowRimIsAsLargeAsBoth) {
  constexpr std::uint32_t kTexels = 64, kViews = 16;
  SceneBuilder builder;
  const auto floor = addFloor(builder, kTexels);
  builder.add({{-0.19F, -0.19F, 0.0F}, {0.38F, 0, 0}, {0, 0.38F, 0}, 1, 1});
  for (const float at : {-0.2F, 0.19F}) {
    builder.add({{at, -0.2F, 0.0F}, {0.01F, 0, 0}, {0, 0.4F, 0}, 1, 1});
    builder.add({{-0.19F, at, 0.0F}, {0.38F, 0, 0}, {0, 0.01F, 0}, 1, 1});
  }
  solver::ShotBatch batch;
  solver::ParallelShot shot;
  shot.irradiance = {1.0 / kViews, 0.0, 0.0};
  shot.emitted = shot.irradiance;
  shot.view_count = kViews;
  shot.resolution = 64;
  shot.receivers.count = 8;
  for (std::uint32_t p = 0; p < 8; ++p) {
    const auto at = scene::latticePoint(p, 8);
    shot.receivers.at[p] = glm::vec2(at);
  }
  batch.parallel = {shot};
  std::mt19937 random(3);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  for (std::uint32_t v = 0; v < kViews; ++v) {
    const float angle = 6.2831853F * unit(random);
    batch.views.push_back({{0, 0, 1}, {std::cos(angle), std::sin(angle), 0}, {unit(random), unit(random)}});
  }
  const auto scene = builder.build();
  const auto flux = run(scene, batch);
  double dark = 0.0;
  for (std::uint32_t y = 0; y < kTexels; ++y) {
    for (std::uint32_t x = 0; x < kTexels; ++x)
      dark += (1.0 - irradiance(*scene, flux, floor, x, y)) / (kTexels * kTexels);
  }
  EXPECT_NEAR(dark / 0.16, 1.0, 0.01);  // 512 receiving points along each edge
}

TEST_P(Punctual, TheInsideOfAThinPlateOfTwoSidedFacesStaysDark) {
  SceneBuilder builder;
  const auto plate = builder.addBevelledPlate();
  builder.add({{-1.0F, -1.0F, -0.5F}, {2, 0, 0}, {0, 2, 0}, 20, 20});
  const auto scene = builder.build();
  solver::LightSources sky, lamp, sun;
  sky.sky = {glm::vec3(1.0F), glm::vec3(1.0F)};
  lamp.lights = {{.position = {0.1, 0.05, 0.4}, .intensity = glm::vec3(1e5F)}};
  sun.lights = {{.kind = scene::LightKind::kDirectional, .direction = {0.2, 0.3, -0.9}, .intensity = glm::vec3(1e5F)}};
  for (const auto& sources : {sky, lamp, sun})
    EXPECT_LT(shareInside(*scene, runRound(scene, sources), plate), 3e-5);  // of the sky's light the rim has more
}

TEST_P(Punctual, AHalfPlaneHidesAPointLightBehindAStraightEdge) {
  SceneBuilder builder;
  const auto floor = builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 64, 16});
  builder.add({{-2.0F, -2.0F, 0.0F}, {2, 0, 0}, {0, 4, 0}, 4, 4, true});  // covers x < 0 half-way up
  const auto scene = builder.build();
  const solver::LightSources sources{{{.position = {0.0, 0.0, 0.5}, .intensity = {1.0F, 0.0F, 0.0F}}}, {}};
  const auto flux = runRound(scene, sources);
  for (std::uint32_t x = 0; x < 64; ++x) {
    const glm::dvec3 d = glm::dvec3(0.0, 0.0, 0.5) - glm::dvec3(-0.5 + (x + 0.5) / 64.0, -0.5 + 8.5 / 16.0, -0.5);
    const double open = 1.0 / std::pow(glm::length(d), 3.0);
    const double share = irradiance(*scene, flux, floor, x, 8) / open;
    if (x < 32) {
      EXPECT_EQ(share, 0.0) << x;  // the edge lies between leaves 31 and 32, and is kept to less than a pixel
    } else {
      EXPECT_NEAR(share, 1.0, 0.01) << x;  // receiving points are jittered
    }
  }
}

TEST_P(Punctual, AnEditReplaysAndCancelsToTheLastBit) {
  const auto scene = randomRoom(60, 4000, 1);
  solver::LightSources on;
  on.lights = {{.position = {0.1, 0.3, 0.2}, .intensity = {0.3F, 1.0F / 3.0F, 7e-4F}},
               {.kind = scene::LightKind::kSpot, .position = {-0.2, 0.1, 0.3}, .intensity = {1.0F, 2.0F, 0.1F}},
               {.kind = scene::LightKind::kDirectional, .intensity = {1.0F, 1.0F, 1.0F}}};
  on.sky = {glm::vec3(0.7F), glm::vec3(0.1F, 0.2F, 0.3F)};
  ASSERT_TRUE(transport_->setScene(scene).has_value());
  solver::PunctualLights lights(*scene, on, {});
  auto flux = accumulators(*scene);
  const auto deliver = [&](std::uint32_t rounds) {
    while (lights.hasSlice(rounds)) {
      solver::ShotBatch batch;
      batch.flux_scale = kFluxScale;
      lights.addSlice(rounds, batch);
      ASSERT_TRUE(transport_->run(batch, flux).has_value());
    }
  };
  deliver(1);
  deliver(2);
  EXPECT_NE(flux.gathered, solver::Flux3{});
  lights.setSources(*scene, {});
  EXPECT_GT(lights.owed(2), 0.0);
  deliver(2);
  for (const auto& node : flux.node[0]) ASSERT_EQ(node, solver::Flux3{});
  for (const auto& node : flux.node[1]) ASSERT_EQ(node, solver::Flux3{});
  EXPECT_EQ(flux.escaped, solver::Flux3{});
  EXPECT_EQ(flux.backface, solver::Flux3{});
}

TEST_P(Punctual, AMovedAndDimmedLightEqualsTheSameLightFromTheStart) {
  const auto scene = randomRoom(60, 2000, 3);
  const auto at = [](double x, float strength) {
    return solver::LightSources{{{.position = {x, 0.2, 0.1}, .intensity = glm::vec3(strength)}}, {}};
  };
  ASSERT_TRUE(transport_->setScene(scene).has_value());
  const auto deliver = [&](solver::PunctualLights& lights, solver::FluxAccumulators& flux) {
    while (lights.hasSlice(2)) {
      solver::ShotBatch batch;
      batch.flux_scale = kFluxScale;
      lights.addSlice(2, batch);
      ASSERT_TRUE(transport_->run(batch, flux).has_value());
    }
  };
  solver::PunctualLights edited(*scene, at(-0.3, 8.0F), {}), fresh(*scene, at(0.3, 2.0F), {});
  auto by_edit = accumulators(*scene), by_start = accumulators(*scene);
  deliver(edited, by_edit);
  edited.setSources(*scene, at(0.3, 2.0F));
  deliver(edited, by_edit);
  deliver(fresh, by_start);
  EXPECT_EQ(by_edit.node, by_start.node);
}

TEST_P(Punctual, WorkersDeliverTheSameBitsAsOneProcess) {
  const auto scene = randomRoom(100, 4000, 5);
  solver::LightSources sources;
  sources.lights = {{.position = {0.1, 0.3, 0.2}, .intensity = {1.0F, 2.0F, 3.0F}},
                    {.kind = scene::LightKind::kDirectional, .intensity = {1.0F, 1.0F, 1.0F}}};
  sources.sky = {glm::vec3(0.7F), glm::vec3(0.1F)};
  const auto alone = runRound(scene, sources);
  auto workers = gpu::makeWorkerTransport({.workers = 3, .executable = RADIOSITY_GL_WORKER, .sight = GetParam()});
  ASSERT_TRUE(workers.has_value()) << workers.error().text();
  transport_ = std::move(*workers);
  EXPECT_NE(transport_->description().find(gpu::sightText(GetParam())), std::string::npos) << transport_->description();
  const auto shared = runRound(scene, sources);
  EXPECT_EQ(alone.node, shared.node);
  EXPECT_EQ(alone.escaped, shared.escaped);
  EXPECT_EQ(alone.backface, shared.backface);
}

TEST_P(Punctual, ASheetOfOpacityAThirdLetsTwoThirdsThrough) {
  SceneBuilder builder;
  const auto floor = addFloor(builder);
  const auto sheet = builder.add({{-1.0F, -1.0F, 0.0F}, {2, 0, 0}, {0, 2, 0}, 8, 8, true});
  auto scene = std::make_shared<scene::PatchScene>(*builder.build());
  scene->surfaces[sheet].see_through = true;
  scene->opacity.assign(64, 85);
  for (std::size_t node = scene->surfaces[sheet].first_node[0]; node < scene->node_area.size(); ++node) {
    scene->node_area[node] /= 3.0F;
  }
  const solver::LightSources sources{
      {{.kind = scene::LightKind::kDirectional, .direction = {0, 0, -1}, .intensity = {1.0F, 0.0F, 0.0F}}}, {}};
  const auto flux = runRound(scene, sources);
  double mean = 0.0;
  for (std::uint32_t leaf = 0; leaf < 256; ++leaf) mean += irradiance(*scene, flux, floor, leaf % 16, leaf / 16) / 256;
  // 256 leaves x 32 looks, each seen or not: sigma 0.47 / sqrt(8192) = 0.5 %
  EXPECT_NEAR(mean, 2.0 / 3.0, 0.016);
  // Each leaf by a chance of its own in each look: of 32 looks no leaf is left with all or none (1 in 4e5).
  for (std::uint32_t leaf = 0; leaf < 256; ++leaf) {
    EXPECT_GT(irradiance(*scene, flux, floor, leaf % 16, leaf / 16), 0.1) << leaf;
    EXPECT_LT(irradiance(*scene, flux, floor, leaf % 16, leaf / 16), 0.999) << leaf;
  }
  EXPECT_NEAR(irradiance(*scene, flux, sheet, 3, 4), 1.0, 1e-5) << "irradiance on the sheet itself is whole";
}

TEST_P(Punctual, AHoleInASheetLetsALightThroughAndNothingElseDoes) {
  SceneBuilder builder;
  const auto floor = addFloor(builder);
  const auto sheet = builder.add({{-0.5F, -0.5F, 0.0F}, {1, 0, 0}, {0, 1, 0}, 4, 4, true});
  auto scene = std::make_shared<scene::PatchScene>(*builder.build());
  scene->surfaces[sheet].see_through = true;
  scene->opacity.assign(16, 255);
  scene->opacity[5] = 0;  // leaf (1, 1): x and y from -1/4 to 0
  const solver::LightSources sources{
      {{.kind = scene::LightKind::kDirectional, .direction = {0, 0, -1}, .intensity = {1.0F, 0.0F, 0.0F}}}, {}};
  const auto flux = runRound(scene, sources);
  for (std::uint32_t y = 0; y < 16; ++y) {
    for (std::uint32_t x = 0; x < 16; ++x) {
      const bool open = x >= 4 && x < 8 && y >= 4 && y < 8;
      const bool edge = x >= 3 && x <= 8 && y >= 3 && y <= 8 && !(x > 4 && x < 7 && y > 4 && y < 7);
      if (edge) continue;
      EXPECT_NEAR(irradiance(*scene, flux, floor, x, y), open ? 1.0 : 0.0, 1e-5) << x << ", " << y;
    }
  }
}

TEST_P(Punctual, AShotOutsideTheContractIsRefused) {
  SceneBuilder builder;
  addFloor(builder);
  const auto scene = builder.build();
  ASSERT_TRUE(transport_->setScene(scene).has_value());
  auto flux = accumulators(*scene);
  solver::ShotBatch batch;
  batch.point_lights = {downwardShot({})};
  batch.point_lights[0].receivers.count = 9;
  EXPECT_FALSE(transport_->run(batch, flux).has_value());
  batch.point_lights.clear();
  batch.parallel.resize(1);  // whose view is missing
  EXPECT_FALSE(transport_->run(batch, flux).has_value());
}

INSTANTIATE_TEST_SUITE_P(Sight, Punctual, kBothSights, nameOfSight);

}  // namespace
}  // namespace radiosity::test
