// Direct light gathered at leaves: exact where nothing is in between, exact umbra, penumbra and energy.
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <span>

#include "server/scene/burial/coverage.h"
#include "server/scene/charts/build.h"
#include "server/solver/math/polygon_form_factor.h"
#include "tests/gl/gather_fixture.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::test {
namespace {

TEST(PolygonFormFactor, MatchesTheClosedFormOfAPointFacingARectangle) {
  // receiver under the corner of an a x b rectangle at distance c
  const double a = 0.7, b = 0.4, c = 0.9;
  const double x = a / c, y = b / c;
  const double exact = (x / std::sqrt(1 + x * x) * std::atan(y / std::sqrt(1 + x * x)) +
                        y / std::sqrt(1 + y * y) * std::atan(x / std::sqrt(1 + y * y))) /
                       (2 * std::numbers::pi);
  const std::array<glm::vec3, 4> corners{glm::vec3(0, 0, 0.9F), {0, 0.4F, 0.9F}, {0.7F, 0.4F, 0.9F}, {0.7F, 0, 0.9F}};
  EXPECT_NEAR(solver::polygonFormFactor({0, 0, 0}, {0, 0, 1}, corners), exact, 1e-7);
}

TEST(PolygonFormFactor, ClipsAtTheHorizon) {
  // an upright rectangle of height 2h centred on the horizon gives the same as its upper half
  const std::array<glm::vec3, 4> whole{glm::vec3(-1, 1, -0.5F), {1, 1, -0.5F}, {1, 1, 0.5F}, {-1, 1, 0.5F}};
  const std::array<glm::vec3, 4> half{glm::vec3(-1, 1, 0), {1, 1, 0}, {1, 1, 0.5F}, {-1, 1, 0.5F}};
  const auto expected = solver::polygonFormFactor({0, 0, 0}, {0, 0, 1}, half);
  EXPECT_GT(expected, 0.01);
  EXPECT_NEAR(solver::polygonFormFactor({0, 0, 0}, {0, 0, 1}, whole), expected, 1e-12);
  EXPECT_EQ(solver::polygonFormFactor({0, 0, 1}, {0, 0, 1}, half), 0.0);
}

TEST_P(Gather, UnoccludedIrradianceIsLambertsFormula) {
  SceneBuilder builder;
  const auto floor = builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 16, 16});
  const auto lamp = builder.add({{-0.1F, -0.2F, 0.4F}, {0, 0.3F, 0}, {0.2F, 0, 0}, 1, 1});
  const auto scene = builder.build();
  std::mt19937 random(1);
  const auto batch = gatherFrom(*scene, lamp, 4, random);
  const auto flux = run(scene, batch);
  for (std::uint32_t y = 0; y < 16; ++y) {
    for (std::uint32_t x = 0; x < 16; ++x) {
      const glm::dvec3 point(-0.5 + (x + 0.5) / 16, -0.5 + (y + 0.5) / 16, -0.5);
      const auto exact = solver::polygonFormFactor(
          point, {0, 0, 1}, std::span(batch.gather[0].corners).first(batch.gather[0].corner_count));
      EXPECT_NEAR(irradiance(*scene, flux, floor, x, y), exact, 1e-5 * exact) << x << ", " << y;
    }
  }
}

// Two fifths of the lamp lie behind the wall's plane. Single points on it, which lie in front or behind by chance, must
// give the form factor of the part in front in the mean.
TEST_P(Gather, OfALampThatAWallsPlaneCutsThePartInFrontIsReceived) {
  SceneBuilder builder;
  const auto wall = builder.add({{0.0F, -0.3F, -0.5F}, {0, 0, 0.6F}, {0, 0.6F, 0}, 6, 6});  // faces -x
  const auto lamp = builder.add({{-0.3F, -0.4F, 0.45F}, {0, 0.8F, 0}, {0.5F, 0, 0}, 1, 1});
  const auto scene = builder.build();
  const auto normal = glm::dvec3(scene->triangles[scene->surfaces[wall].first_triangle].normal);
  constexpr int kShots = 400;
  std::mt19937 random(7);
  std::vector<double> sum(36, 0.0);
  solver::ShotBatch batch;
  for (int i = 0; i < kShots; ++i) {
    batch = gatherFrom(*scene, lamp, 1, random);
    const auto flux = run(scene, batch);
    for (std::uint32_t k = 0; k < 36; ++k) sum[k] += irradiance(*scene, flux, wall, k % 6, k / 6) / kShots;
  }
  const auto& chart = scene->surfaces[wall];
  const auto& frame = scene->triangles[chart.first_triangle];
  double all = 0.0, exact = 0.0;
  for (std::uint32_t k = 0; k < 36; ++k) {
    const auto at =
        frame.origin + (static_cast<float>(k % 6) + 0.5F) * frame.du + (static_cast<float>(k / 6) + 0.5F) * frame.dv;
    all += sum[k];
    exact += solver::polygonFormFactor(glm::dvec3(at), normal,
                                       std::span(batch.gather[0].corners).first(batch.gather[0].corner_count));
  }
  EXPECT_GT(exact, 0.5);
  // The point lies in front in three of five shots, binomially: standard error sqrt(0.4 / 0.6 / 400) = 4 %.
  EXPECT_NEAR(all / exact, 1.0, 0.12);
}

// Many texels away: what is near looks from two places.
// Where nothing hides anything a half keeps 0.15 of what the two opposite places differ by; elsewhere all, since which
// of them is hidden goes with how much they get.
TEST_P(Gather, TheReceiverJitterMovesTheReceivingPoint) {
  for (const bool has_wall : {false, true}) {
    SCOPED_TRACE(has_wall);
    SceneBuilder builder;
    const auto floor = builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 32, 32});
    const auto lamp = builder.add({{-0.1F, -0.2F, 0.4F}, {0, 0.3F, 0}, {0.2F, 0, 0}, 1, 1});
    if (has_wall) builder.add({{0.45F, -0.5F, -0.5F}, {0, 0.1F, 0}, {0, 0, 0.1F}, 1, 1});
    const auto scene = builder.build();
    std::mt19937 random(1);
    auto batch = gatherFrom(*scene, lamp, 2, random);
    batch.gather[0].receiver_jitter = {0.125F, 0.75F};
    const auto flux = run(scene, batch);
    const auto at = [&](double x, double y) {
      return solver::polygonFormFactor({-0.5 + x / 32, -0.5 + y / 32, -0.5}, {0, 0, 1},
                                       std::span(batch.gather[0].corners).first(batch.gather[0].corner_count));
    };
    const double here = at(9.125, 22.75), opposite = at(9.875, 22.25);
    const double exact = has_wall ? here : 0.575 * here + 0.425 * opposite;
    ASSERT_GT(std::abs(here - opposite), 1e-2 * exact);
    EXPECT_NEAR(irradiance(*scene, flux, floor, 9, 22), exact, 1e-5 * exact);
  }
}

/// Share of the lamp's interval [-0.1, 0.1] that a point at distance x from the blocker's edge line sees past a
/// half-plane: similar triangles, blocker half-way between lamp and floor.
double visibleShare(double x) { return std::clamp((x + 0.1) / 0.2, 0.0, 1.0); }

// A lamp as large as a texel, and the texel at its foot: across it the form factor falls from 0.5 to 0.07.
TEST_P(Gather, AReceiverCloseByLooksFromOppositePlacesAndTheHalvesFromFour) {
  constexpr float kTexel = 1.0F / 16.0F;
  SceneBuilder builder;
  const auto floor = builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 16, 16});
  const auto lamp = builder.add({{-0.5F, 0, -0.5F}, {0, kTexel, 0}, {0, 0, kTexel}, 1, 1});
  const auto scene = builder.build();
  std::mt19937 random(3);
  auto batch = gatherFrom(*scene, lamp, 1, random);
  auto& shot = batch.gather[0];
  const auto at = [&](const glm::dvec2& place) {
    const glm::dvec3 point(-0.5 + kTexel * place.x, kTexel * place.y, -0.5);
    return solver::polygonFormFactor(point, {0, 0, 1}, std::span(shot.corners).first(shot.corner_count));
  };
  double mean = 0.0, one_place = 0.0, halves = 0.0, all = 0.0;
  for (std::uint32_t k = 0; k < 64 * 64; ++k) mean += at({(k % 64 + 0.5) / 64, (k / 64 + 0.5) / 64}) / (64 * 64);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  for (std::uint32_t trial = 0; trial < 16; ++trial) {
    const glm::vec2 jitter(unit(random), unit(random));
    std::array<double, 2> half{};
    for (std::size_t h = 0; h < 2; ++h) {
      shot.receiver_jitter = h == 0 ? jitter : 1.0F - jitter;
      half[h] = irradiance(*scene, run(scene, batch), floor, 0, 8);
    }
    const glm::dvec2 across = jitter.x <= 0.5F ? jitter : 1.0F - jitter;
    const auto inverted = [](double offset) { return std::copysign(0.5 - std::abs(offset), offset); };
    const glm::dvec2 other(0.5 + inverted(0.5 - across.x), 0.5 - inverted(0.5 - across.y));
    const double sum = at(across) + at(1.0 - across) + at(other) + at(1.0 - other);
    EXPECT_NEAR(half[0] + half[1], 0.5 * sum, 1e-3 * sum);
    one_place += std::pow(at(across) - at(1.0 - across), 2.0);
    halves += std::pow(half[0] - half[1], 2.0);
    all += std::pow(0.5 * (half[0] + half[1]) - mean, 2.0);
  }
  EXPECT_LT(halves, 0.04 * one_place) << "what is linear in the place cancels in each half, and most of what is not";
  // Half of the difference is what the mean errs by, as root mean squares over jitters within 1.5 times.
  EXPECT_LT(all, 2.25 * 0.25 * halves);
  EXPECT_GT(2.25 * all, 0.25 * halves);
}

TEST_P(Gather, AHalfPlaneCastsAnExactUmbraAndPenumbra) {
  SceneBuilder builder;
  const auto floor = builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 64, 2});
  const auto lamp = builder.add({{-0.1F, -0.01F, 0.5F}, {0, 0.02F, 0}, {0.2F, 0, 0}, 1, 1});
  builder.add({{-2.0F, -2.0F, 0.0F}, {2, 0, 0}, {0, 4, 0}, 4, 4, true});  // covers x < 0 half-way up
  const auto scene = builder.build();
  std::mt19937 random(4);
  auto batch = gatherFrom(*scene, lamp, 16, random);
  batch.gather[0].resolution = 512;
  const auto flux = run(scene, batch);
  for (std::uint32_t x = 0; x < 64; ++x) {
    const double at = -0.5 + (x + 0.5) / 64;
    const auto open = solver::polygonFormFactor({at, -0.25, -0.5}, {0, 0, 1},
                                                std::span(batch.gather[0].corners).first(batch.gather[0].corner_count));
    const double share = irradiance(*scene, flux, floor, x, 0) / open;
    if (at < -0.11) {
      EXPECT_EQ(share, 0.0) << at;
    } else if (at > 0.11) {
      EXPECT_NEAR(share, 1.0, 1e-4) << at;
    } else {
      EXPECT_NEAR(share, visibleShare(at), 0.05) << at;
    }
  }
}

// A panel hangs half a thousandth before a ceiling. Pixels are wider than the leaves along its rim, and those under it
// are dark: what pixels took from the leaves beside it, none would gain.
TEST_P(Gather, LeavesBesideAPanelThatHangsBeforeThemLoseNothingToIt) {
  SceneBuilder builder;
  const auto ceiling = builder.add({{-0.5F, 0.5F, 0.5F}, {1, 0, 0}, {0, -1, 0}, 40, 40});
  builder.add({{0.0F, 0.25F, 0.4995F}, {0.3F, 0, 0}, {0, -0.5F, 0}, 1, 1});
  const auto lamp = builder.add({{-0.1F, -0.1F, -0.5F}, {0.2F, 0, 0}, {0, 0.2F, 0}, 1, 1});
  auto made = std::make_shared<scene::PatchScene>(*builder.build());
  scene::placeSpotsInGaps(*made);
  const std::shared_ptr<const scene::PatchScene> scene = made;
  std::mt19937 random(3);
  const auto batch = gatherFrom(*scene, lamp, 8, random);
  const auto flux = run(scene, batch);
  const auto corners = std::span(batch.gather[0].corners).first(batch.gather[0].corner_count);
  double beside = 0.0, under = 0.0, open = 0.0;
  for (std::uint32_t y = 12; y < 28; ++y) {
    beside += irradiance(*scene, flux, ceiling, 19, y);
    under += irradiance(*scene, flux, ceiling, 20, y);
    open += solver::polygonFormFactor({-0.0125, 0.5 - (y + 0.5) / 40, 0.5}, {0, 0, -1}, corners);
  }
  // In the gap one sees at most what lies to the side of the panel: 0.0005 of a leaf's 0.025.
  EXPECT_NEAR(beside / open, 1.0, 0.02);
  EXPECT_NEAR(under / open, 0.0, 0.02);
}

// An item names one triangle of the panel, of which all may lie farther from the lamp than the leaf that the other one
// hides.
TEST_P(Gather, LeavesUnderAPanelAreDarkForLampsOnAllSides) {
  for (const auto& way : {glm::vec2(1, 0), glm::vec2(0, 1), glm::vec2(-1, 0), glm::vec2(0, -1), glm::vec2(1, 1)}) {
    SceneBuilder builder;
    const auto ceiling = builder.add({{-0.5F, 0.5F, 0.5F}, {1, 0, 0}, {0, -1, 0}, 40, 40});
    builder.add({{-0.2F, 0.2F, 0.4995F}, {0.4F, 0, 0}, {0, -0.4F, 0}, 1, 1});
    const auto at = 0.3F * way;
    const auto lamp = builder.add({{at.x - 0.05F, at.y - 0.05F, 0.2F}, {0.1F, 0, 0}, {0, 0.1F, 0}, 1, 1});
    auto made = std::make_shared<scene::PatchScene>(*builder.build());
    scene::placeSpotsInGaps(*made);
    const std::shared_ptr<const scene::PatchScene> scene = made;
    std::mt19937 random(3);
    const auto flux = run(scene, gatherFrom(*scene, lamp, 8, random));
    double under = 0.0;
    for (std::uint32_t y = 14; y < 26; ++y) {
      for (std::uint32_t x = 14; x < 26; ++x) under += irradiance(*scene, flux, ceiling, x, y);
    }
    EXPECT_GT(irradiance(*scene, flux, ceiling, 20, way.y > 0.0F ? 5 : 35), 0.0);
    EXPECT_EQ(under, 0.0) << way.x << " " << way.y;
  }
}

// Pixels along its rim show the cap, behind whose plane the topmost leaves of the side lie. It cannot hide a light from
// them: none of it lies before their horizon, though a box around it does.
TEST_P(Gather, TheCapOfAColumnHidesNothingFromItsSide) {
  constexpr int kSides = 24;
  constexpr double kRadius = 0.5, kHeight = 1.0;
  scene::Primitive cap, side;
  cap.positions.push_back({0, kHeight, 0});
  for (int i = 0; i < kSides; ++i) {
    const double angle = 2.0 * std::numbers::pi * i / kSides, next = 2.0 * std::numbers::pi * (i + 1) / kSides;
    const glm::dvec3 a(kRadius * std::cos(angle), 0, -kRadius * std::sin(angle));
    const glm::dvec3 b(kRadius * std::cos(next), 0, -kRadius * std::sin(next)), up(0, kHeight, 0);
    cap.positions.push_back(a + up);
    const auto k = static_cast<std::uint32_t>(i);
    cap.indices.insert(cap.indices.end(), {0, k + 1, (k + 1) % kSides + 1});
    scene::test::addQuad(side, a, b, b + up, a + up);
  }
  const std::array<glm::dvec3, 4> lamp{{{1.0, 1.6, -0.3}, {1.4, 1.6, -0.3}, {1.4, 1.6, 0.3}, {1.0, 1.6, 0.3}}};
  scene::Primitive light;
  scene::test::addQuad(light, lamp[0], lamp[1], lamp[2], lamp[3]);
  scene::Scene made;
  for (const auto& primitive : {cap, side, light}) scene::test::place(made, primitive);
  scene::ChartOptions options;
  options.texel_budget = 4000;
  const auto built = scene::buildPatchScene(made, options);
  ASSERT_TRUE(built.has_value());
  const auto scene = std::make_shared<const scene::PatchScene>(*built);
  solver::ShotBatch batch;
  batch.flux_scale = kFluxScale;
  solver::GatherShot shot;
  shot.corner_count = 4;
  shot.normal = {0, -1, 0};
  for (std::size_t i = 0; i < 4; ++i) shot.corners[i] = glm::vec3((lamp[i] - scene->centre) / scene->scale);
  shot.radiosity = {1.0, 1.0, 1.0};
  shot.resolution = 64;
  shot.point_count = 64;
  for (std::uint32_t i = 0; i < 64; ++i) {
    solver::HemicubeFrame frame;
    const float u = (static_cast<float>(i % 8) + 0.5F) / 8.0F, v = (static_cast<float>(i / 8) + 0.5F) / 8.0F;
    frame.origin = shot.corners[0] + u * (shot.corners[1] - shot.corners[0]) + v * (shot.corners[3] - shot.corners[0]);
    frame.normal = shot.normal;
    frame.tangent = {std::cos(static_cast<float>(i)), 0, std::sin(static_cast<float>(i))};
    frame.lattice = i % 16;
    batch.points.push_back(frame);
  }
  batch.gather = {shot};
  const auto flux = run(scene, batch);
  const auto corners = std::span(batch.gather[0].corners).first(4);
  std::size_t lit = 0;
  for (const auto& surface : scene->surfaces) {
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
      const auto& leaf = scene->leaves[surface.first_leaf + i];
      if (leaf.triangle == scene::kNone || !leaf.full) continue;
      const auto& frame = scene->triangles[leaf.triangle];
      if (std::abs(frame.normal.y) > 0.5F) continue;
      const auto place = frame.origin + leaf.texel.x * frame.du + leaf.texel.y * frame.dv;
      const double open = solver::polygonFormFactor(glm::dvec3(place), glm::dvec3(frame.normal), corners);
      if (open < 0.002) continue;
      const auto node = surface.first_node[0] + i;
      const double found = static_cast<double>(flux.node[0][node][0] + flux.node[1][node][0]) / kFluxScale /
                           static_cast<double>(scene->node_area[node]);
      EXPECT_GT(found / open, 0.9) << place.x << " " << place.y << " " << place.z;
      ++lit;
    }
  }
  EXPECT_GT(lit, 200U);
}

// Seen from the lamp, pixels along the silhouette of a box show the floor beyond it, and what lies inside, where both
// sides of a wall are surfaces, lies before that.
TEST_P(Gather, TheInsideOfAClosedBoxOfTwoSidedWallsStaysDark) {
  SceneBuilder builder;
  builder.add({{-1.0F, -1.0F, -0.5F}, {2, 0, 0}, {0, 2, 0}, 20, 20});
  const std::uint32_t first = builder.add({{-0.2F, -0.2F, -0.3F}, {0.4F, 0, 0}, {0, 0.4F, 0}, 16, 16, true});
  builder.add({{-0.2F, -0.2F, -0.1F}, {0.4F, 0, 0}, {0, 0.4F, 0}, 16, 16, true});
  builder.add({{-0.2F, -0.2F, -0.3F}, {0, 0.4F, 0}, {0, 0, 0.2F}, 16, 8, true});
  builder.add({{0.2F, -0.2F, -0.3F}, {0, 0.4F, 0}, {0, 0, 0.2F}, 16, 8, true});
  builder.add({{-0.2F, -0.2F, -0.3F}, {0.4F, 0, 0}, {0, 0, 0.2F}, 16, 8, true});
  const std::uint32_t last = builder.add({{-0.2F, 0.2F, -0.3F}, {0.4F, 0, 0}, {0, 0, 0.2F}, 16, 8, true});
  const auto lamp = builder.add({{-0.1F, -0.1F, 0.4F}, {0, 0.2F, 0}, {0.2F, 0, 0}, 1, 1});
  const auto scene = builder.build();
  std::mt19937 random(11);
  const auto flux = run(scene, gatherFrom(*scene, lamp, 8, random));
  for (auto s = first; s <= last; ++s) {
    const auto& wall = scene->surfaces[s];
    const auto inward = glm::dot(scene->triangles[wall.first_triangle].normal,
                                 glm::vec3(0.0F, 0.0F, -0.2F) - 0.5F * (wall.bounds_min + wall.bounds_max)) > 0.0F;
    ASSERT_NE(wall.first_node[1], scene::kNone);
    for (std::uint32_t i = 0; i < wall.width * wall.height; ++i)
      EXPECT_EQ(flux.node[0][wall.first_node[inward ? 0 : 1] + i][0], 0) << s << " " << i;
  }
}

// A table top: pixels are wider than its rim and its bevel together, so that most show what lies beyond.
TEST_P(Gather, TheInsideOfAThinBevelledPlateOfTwoSidedFacesStaysDark) {
  SceneBuilder builder;
  builder.add({{-1.0F, -1.0F, -0.5F}, {2, 0, 0}, {0, 2, 0}, 20, 20});
  const auto plate = builder.addBevelledPlate();
  const auto lamp = builder.add({{-0.1F, -0.1F, 0.4F}, {0, 0.2F, 0}, {0.2F, 0, 0}, 1, 1});
  const auto scene = builder.build();
  std::mt19937 random(11);
  const auto flux = run(scene, gatherFrom(*scene, lamp, 8, random));
  // What is no farther from a bevel's plane than kInPlane counts as lying in it: a thousandth of the rim's height, and
  // of the light that falls on the rim, which is a hundredth of all.
  EXPECT_LT(shareInside(*scene, flux, plate), 1e-5);
}

TEST_P(Gather, AClosedBoxReceivesWhatTheLampEmits) {
  SceneBuilder builder;
  builder.addBox(glm::vec3(-0.5F), glm::vec3(0.5F), 48, true);
  const auto lamp = builder.add({{-0.1F, -0.1F, 0.3F}, {0, 0.2F, 0}, {0.2F, 0, 0}, 1, 1});
  const auto scene = builder.build();
  std::mt19937 random(9);
  const auto flux = run(scene, gatherFrom(*scene, lamp, 4, random));
  const double emitted = 0.04 * kFluxScale;
  EXPECT_NEAR(static_cast<double>(flux.gathered[0]), emitted, 0.01 * emitted);
  EXPECT_NEAR(static_cast<double>(flux.gathered[1]), 2 * emitted, 0.02 * emitted);
  EXPECT_EQ(flux.gathered[2], 0);
  EXPECT_EQ(flux.escaped[0], 0);
  EXPECT_EQ(flux.backface[0], 0);
}

TEST_P(Gather, LightLeavingTheSceneIsCountedByHowItIsLost) {
  SceneBuilder builder;
  const auto lamp = builder.add({{-0.5F, -0.5F, -0.5F}, {1, 0, 0}, {0, 1, 0}, 1, 1});
  builder.add({{-0.5F, -0.5F, 0.5F}, {1, 0, 0}, {0, 1, 0}, 8, 8});  // shows its back
  const auto scene = builder.build();
  std::mt19937 random(9);
  auto batch = gatherFrom(*scene, lamp, 16, random);
  const auto flux = run(scene, batch);
  EXPECT_EQ(flux.gathered[0], 0);
  EXPECT_NEAR(static_cast<double>(flux.backface[0]) / kFluxScale, 0.1998248957, 0.001);
  EXPECT_NEAR(static_cast<double>(flux.backface[0] + flux.escaped[0]) / kFluxScale, 1.0, 1e-9);
}

TEST_P(Gather, OppositeShotsCancelToExactlyNothing) {
  const auto scene = randomRoom(60, 4000, 1);
  std::mt19937 random(9);
  auto batch = gatherFrom(*scene, 5, 4, random);
  batch.gather[0].radiosity = {0.3, 1.0 / 3.0, 7e-4};
  batch.gather.push_back(batch.gather[0]);
  for (auto& channel : batch.gather[1].radiosity) channel = -channel;
  const auto flux = run(scene, batch);
  for (const auto& node : flux.node[0]) ASSERT_EQ(node, solver::Flux3{});
  EXPECT_EQ(flux.gathered, solver::Flux3{});
  EXPECT_EQ(flux.backface, solver::Flux3{});
}

// A look that comes alone is drawn around its window and no further; of several in one image faces are filled. How many
// come at once follows from how many workers there are.
TEST_P(Gather, ThroughAWindowLinksAreTheSameBitsAloneAndAmongOthers) {
  std::mt19937 random(3);
  std::uniform_real_distribution<float> place(-0.45F, 0.35F), size(0.02F, 0.1F);
  SceneBuilder builder;
  builder.addBox(glm::vec3(-0.5F), glm::vec3(0.5F), 8, true);
  for (int i = 0; i < 60; ++i)  // whose backs take what falls on them
    builder.add({{place(random), place(random), place(random)}, {size(random), 0, 0}, {0, 0.02F, size(random)}, 4, 4});
  const auto scene = builder.build();
  ASSERT_TRUE(transport_->setScene(scene).has_value());
  solver::ShotBatch all;
  std::vector<solver::ShotBatch> alone;
  for (std::uint32_t i = 0; i < 300; ++i) {
    auto batch = gatherFrom(*scene, i % 66, 1, random);
    const auto& seen = scene->surfaces[random() % scene->surfaces.size()];
    const auto& corner = scene->vertices[scene->indices[3 * std::size_t{seen.first_triangle}]].position;
    batch.receivers = {{seen.first_node[0], seen.width * seen.height}};
    batch.boxes = {{corner - 0.03F, corner + 0.03F}};
    auto& shot = batch.gather[0];
    shot.run_count = shot.box_count = 1;
    shot.resolution = 32;
    alone.push_back(batch);
    shot.first_point = shot.first_run = shot.first_box = i;
    all.gather.push_back(shot);
    all.points.push_back(batch.points[0]);
    all.receivers.push_back(batch.receivers[0]);
    all.boxes.push_back(batch.boxes[0]);
  }
  std::vector<solver::LinkSample> together(alone.size());
  ASSERT_TRUE(transport_->measure(all, [&](std::size_t i, solver::LinkSample&& links) { together[i] = links; }));
  std::size_t lost = 0, lit = 0;
  for (std::size_t i = 0; i < alone.size(); ++i) {
    SCOPED_TRACE(i);
    const auto same = [&](std::size_t, solver::LinkSample&& links) {
      EXPECT_EQ(links.irradiance, together[i].irradiance);
      EXPECT_EQ(links.due, together[i].due);
      EXPECT_EQ(links.escaped, together[i].escaped);
      EXPECT_EQ(links.absorbed, together[i].absorbed);
      EXPECT_EQ(links.open_looks.bits, together[i].open_looks.bits);
      lost += links.open_looks.bits != 0 ? 1 : 0;
      lit += links.irradiance.empty() ? 0 : 1;
    };
    ASSERT_TRUE(transport_->measure(alone[i], same));
  }
  EXPECT_GT(lit, 10U);
  EXPECT_GT(lost, 10U);
}

INSTANTIATE_TEST_SUITE_P(Sight, Gather, kBothSights, nameOfSight);

}  // namespace
}  // namespace radiosity::test
