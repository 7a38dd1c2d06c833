// Light at probes, against closed forms; stated standard errors, against how estimates scatter; and what edits cost.
#include "server/solver/probes/probe_set.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using std::numbers::pi;
constexpr std::uint32_t kRays = 256;

/// Level, at y = -0.4 of the unit box.
test::Quad floor(float reflectance = 0.0F) {
  test::Quad quad{{-0.5F, -0.4F, 0.5F}, {1.0F, 0.0F, 0.0F}, {0.0F, 0.0F, -1.0F}};
  quad.reflectance = glm::vec3(reflectance);
  return quad;
}

/// At y = 0.4, of side 0.2; shines downward.
test::Quad lamp(const glm::vec3& emission, float x = -0.1F) {
  test::Quad quad{{x, 0.4F, -0.1F}, {0.2F, 0.0F, 0.0F}, {0.0F, 0.0F, 0.2F}};
  quad.width = quad.height = 1;
  quad.emission = emission;
  return quad;
}

ProbeLattice single(const glm::dvec3& place) { return {place, {}, {1, 1, 1}}; }

class Probes : public testing::Test {
 protected:
  Probes() { show({floor()}); }
  void show(const std::vector<test::Quad>& quads) {
    scene_ = test::makeQuadScene(quads);
    irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(0.0F));
  }
  [[nodiscard]] PlaceLight light() const {
    return PlaceLight({*scene_.patches, nullptr, nullptr, scene_.materials, sources_, irradiance_, difference_});
  }
  [[nodiscard]] ProbeLight at(const glm::dvec3& place, std::uint64_t key = 1) const {
    const auto now = light();
    return ProbeSet(now, single(place), kRays, key).light(now).front();
  }
  /// Mean square over many keys of what is off, in errors as they are stated: of all coefficients together, and of each
  /// by itself where there is one that is stated.
  struct Spread {
    double true_square = 0.0, stated_square = 0.0;
    [[nodiscard]] double ratio() const { return std::sqrt(stated_square / true_square); }
  };
  [[nodiscard]] Spread spreadAt(const glm::dvec3& place, const std::array<glm::dvec3, kHarmonics>& truth) const {
    constexpr std::uint64_t kKeys = 200;
    Spread spread;
    const auto now = light();
    for (std::uint64_t key = 0; key < kKeys; ++key) {
      const auto found = ProbeSet(now, single(place), kRays, 1000 + key).light(now).front();
      for (std::size_t h = 0; h < kHarmonics; ++h) {
        const auto off = glm::dvec3(found.light[h]) - truth[h], stated = glm::dvec3(found.error[h]);
        spread.true_square += glm::dot(off, off);
        spread.stated_square += glm::dot(stated, stated);
      }
    }
    return spread;
  }

  test::QuadScene scene_;
  std::vector<glm::vec3> irradiance_, difference_;
  LightSources sources_;
};

/// Of a polygon with this emission of one that is wholly seen.
std::array<glm::dvec3, kHarmonics> ofLamp(const glm::dvec3& place, const test::Quad& quad, double part = 1.0) {
  const std::array corners{quad.origin, quad.origin + static_cast<float>(part) * quad.du,
                           quad.origin + static_cast<float>(part) * quad.du + quad.dv, quad.origin + quad.dv};
  const auto harmonics = polygonHarmonics(place, corners);
  std::array<glm::dvec3, kHarmonics> light;
  for (std::size_t h = 0; h < kHarmonics; ++h) light[h] = glm::dvec3(quad.emission) / pi * harmonics[h];
  return light;
}

TEST_F(Probes, UnderALampHaveItsHarmonicsExactly) {
  const auto quad = lamp({30.0F, 20.0F, 10.0F});
  show({floor(), quad});
  const glm::dvec3 place(0.2, -0.1, 0.15);
  const auto found = at(place);
  const auto expected = ofLamp(place, quad);
  for (std::size_t h = 0; h < kHarmonics; ++h) {
    for (int c = 0; c < 3; ++c) {
      EXPECT_NEAR(found.light[h][c], expected[h][c], 1e-5 * expected[0][c]) << h;
      EXPECT_NEAR(found.error[h][c], 0.0, 1e-6 * expected[0][c]) << h << ": nothing is drawn by chance";
    }
  }
}

TEST_F(Probes, UnderAPointLampHaveTheHarmonicsOfItsDirectionByTheInverseSquare) {
  scene::PunctualLight point;
  const double scale = scene_.patches->scale;
  point.position = scene_.patches->centre + scale * glm::dvec3(0.1, 0.3, 0.0);
  point.intensity = glm::vec3(200.0F, 100.0F, 0.0F);
  sources_.lights = {point};
  const glm::dvec3 place(-0.2, -0.1, 0.15), way = glm::dvec3(0.1, 0.3, 0.0) - place;
  const auto found = at(place);
  const double lux = 200.0 / (scale * scale * glm::dot(way, way));
  const auto expected = harmonicsOf(glm::normalize(way));
  for (std::size_t h = 0; h < kHarmonics; ++h) {
    EXPECT_NEAR(found.light[h].x, lux * expected[h], 1e-5 * lux) << h;
    EXPECT_NEAR(found.light[h].y, 0.5 * lux * expected[h], 1e-5 * lux) << h;
    EXPECT_EQ(found.light[h].z, 0.0F);
  }
}

// Of a hemisphere of radiance L: 2 pi k0 L, and pi k1 L in the direction of its middle; band 2 cancels.
TEST_F(Probes, UnderASkyHaveTheHarmonicsOfAHemisphere) {
  sources_.sky.upper = glm::vec3(10.0F);
  const auto found = at({0.0, 0.2, 0.0});
  const std::array<double, kHarmonics> expected{2.0 * pi * 10.0 * 0.2820948, pi * 10.0 * 0.4886025};
  for (std::size_t h = 0; h < kHarmonics; ++h)
    EXPECT_NEAR(found.light[h].x, expected[h], 4.0 * found.error[h].x + 1e-3 * expected[0]) << h;
  EXPECT_LT(found.error[0].x, 0.03 * expected[0]);
  EXPECT_GT(found.error[1].x, 0.0) << "that of band 0 may be 0: just half of the rays of each round go up";
}

TEST_F(Probes, RightOverALitFloorHaveItsRadianceFromBelow) {
  show({floor(0.5F)});
  irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(80.0F));
  const auto found = at({0.0, -0.3999, 0.0});
  const double radiance = 0.5 * 80.0 / pi;
  EXPECT_NEAR(found.light[0].x, 2.0 * pi * 0.2820948 * radiance,
              4.0 * found.error[0].x + 1e-5 * radiance);  // single precision
  EXPECT_NEAR(found.light[1].x, -pi * 0.4886025 * radiance, 4.0 * found.error[1].x + 1e-5 * radiance);
  EXPECT_LT(found.error[0].x, 0.03 * found.light[0].x);
}

// A sheet hides the half of the lamp that has the greater x.
TEST_F(Probes, InAPenumbraHaveThePartOfALampThatIsSeenAndTellItsErrorTruly) {
  const auto quad = lamp(glm::vec3(30.0F));
  test::Quad sheet{{0.0F, 0.1F, -0.4F}, {0.4F, 0.0F, 0.0F}, {0.0F, 0.0F, 0.8F}};
  show({floor(), quad, sheet});
  const glm::dvec3 place(0.0, -0.2, 0.0);
  const auto expected = ofLamp(place, quad, 0.5);
  const auto found = at(place);
  for (std::size_t h = 0; h < kHarmonics; ++h)
    EXPECT_NEAR(found.light[h].x, expected[h].x, 4.0 * found.error[h].x + 1e-4 * expected[0].x) << h;
  const auto spread = spreadAt(place, expected);
  EXPECT_GT(spread.ratio(), 1.0 / 1.5);
  EXPECT_LT(spread.ratio(), 1.5);
}

TEST_F(Probes, TellTheErrorOfTheirRaysTruly) {
  sources_.sky.upper = glm::vec3(10.0F, 5.0F, 1.0F);
  show({floor(0.5F)});
  irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(40.0F));
  const glm::dvec3 place(0.1, -0.1, 0.05);
  // By 512 times as many rays, of another key.
  const auto now = light();
  std::array<glm::dvec3, kHarmonics> truth{};
  for (std::uint64_t key = 0; key < 8; ++key) {
    const auto found = ProbeSet(now, single(place), 64 * kRays, 77 + key).light(now).front();
    for (std::size_t h = 0; h < kHarmonics; ++h) truth[h] += 0.125 * glm::dvec3(found.light[h]);
  }
  const auto spread = spreadAt(place, truth);
  EXPECT_GT(spread.ratio(), 1.0 / 1.5);
  EXPECT_LT(spread.ratio(), 1.5);
}

// Each leaf is off by itself: what the halves differ by is twice what their mean is off by.
TEST_F(Probes, CountWhatTheSolveIsOffBy) {
  show({floor(0.5F)});
  irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(80.0F));
  const auto sure = at({0.0, 0.1, 0.0});
  for (std::size_t n = 0; n < irradiance_.size(); ++n)
    difference_.push_back(glm::vec3(n * 2654435761U % 97 < 48 ? 40.0F : -40.0F));
  const auto unsure = at({0.0, 0.1, 0.0});
  EXPECT_EQ(unsure.light, sure.light);
  for (std::size_t h = 0; h < kHarmonics; ++h) EXPECT_GT(unsure.error[h].x, sure.error[h].x) << h;
  difference_.assign(irradiance_.size(), glm::vec3(40.0F));
  const auto alike = at({0.0, 0.1, 0.0});
  double square = 0.0, light = 0.0;
  for (std::size_t h = 0; h < kHarmonics; ++h) {
    square += std::pow(alike.error[h].x, 2.0) - std::pow(sure.error[h].x, 2.0);
    light += std::pow(alike.light[h].x, 2.0);
  }
  EXPECT_NEAR(std::sqrt(square / light), 0.25, 1e-3) << "all light is off by 20 of 80 lux";
}

TEST_F(Probes, GiveTheSameBitsAfterEditsOfLightAsAnewAndLookAtNoLampAgain) {
  show({floor(0.5F), lamp({3.0F, 2.0F, 1.0F})});
  irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(2.0F));
  const ProbeLattice lattice{{-0.4, -0.3, -0.4}, {glm::dvec3(0.4, 0, 0), {0, 0.3, 0}, {0, 0, 0.4}}, {3, 2, 3}};
  const auto before = light();
  ProbeSet set(before, lattice, kRays, 1);
  const auto first = set.light(before);
  EXPECT_EQ(set.lampsTaken(), 1U);
  scene_.materials.emission.fill(glm::vec3(0.0F));
  irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(0.0F));
  for (const auto& probe : set.light(light())) EXPECT_EQ(probe.light[0], glm::vec3(0.0F));
  show({floor(0.5F), lamp({1.0F, 2.0F, 3.0F})});
  irradiance_.assign(scene_.patches->nodeCount(), glm::vec3(7.0F));
  const auto after = light();
  ProbeSet anew(after, lattice, kRays, 1);
  const auto kept = set.light(after), made = anew.light(after);
  EXPECT_EQ(set.lampsTaken(), 1U) << "switched off and on again";
  for (std::size_t i = 0; i < kept.size(); ++i) {
    EXPECT_EQ(kept[i].light, made[i].light) << i;
    EXPECT_EQ(kept[i].error, made[i].error) << i;
    EXPECT_NE(kept[i].light, first[i].light) << i;
  }
}

// As panels in a ceiling: together they are drawn from, and tell how much that scatters.
TEST_F(Probes, UnderVeryManyLampsHaveTheLightOfAllOfThem) {
  std::vector<test::Quad> quads{floor()};
  for (int i = 0; i < 40; ++i) {
    quads.push_back(lamp(glm::vec3(10.0F)));
    auto& quad = quads.back();
    quad.origin = {-0.45F + 0.1F * static_cast<float>(i % 8), 0.4F, -0.45F + 0.2F * static_cast<float>(i / 8)};
    quad.du = {0.05F, 0.0F, 0.0F};
    quad.dv = {0.0F, 0.0F, 0.05F};
  }
  show(quads);
  const glm::dvec3 place(0.1, -0.1, 0.05);
  std::array<glm::dvec3, kHarmonics> truth{};
  for (std::size_t i = 1; i < quads.size(); ++i) {
    const auto of = ofLamp(place, quads[i]);
    for (std::size_t h = 0; h < kHarmonics; ++h) truth[h] += of[h];
  }
  const auto found = at(place);
  for (std::size_t h = 0; h < kHarmonics; ++h)
    EXPECT_NEAR(found.light[h].x, truth[h].x, 4.0 * found.error[h].x + 1e-5 * truth[0].x) << h;
  EXPECT_LT(found.error[0].x, 0.05 * truth[0].x);
  EXPECT_LT(spreadAt(place, truth).ratio(), 1.5);
  EXPECT_GT(spreadAt(place, truth).ratio(), 1.0 / 1.5);
}

/// A cube of side 0.4 whose faces look outward.
std::vector<test::Quad> solid() {
  std::vector<test::Quad> quads;
  for (auto quad : test::cubeQuads(4, test::kDark, test::kGrey)) {
    quad.origin = 0.4F * (quad.origin + quad.du);
    quad.dv *= 0.4F;
    quad.du *= -0.4F;
    quads.push_back(quad);
  }
  return quads;
}

TEST_F(Probes, InsideASolidAreMarkedAndFilledFromThoseBesideIt) {
  auto quads = solid();
  quads.push_back(floor());
  show(quads);
  sources_.sky.upper = sources_.sky.lower = glm::vec3(10.0F);
  const ProbeLattice lattice{{-0.3, 0.0, 0.0}, {glm::dvec3(0.1, 0, 0), {}, {}}, {7, 1, 1}};
  const auto now = light();
  ProbeSet set(now, lattice, kRays, 1);
  const auto found = set.light(now);
  std::vector<std::uint32_t> rings;
  for (const auto& probe : found) rings.push_back(probe.ring);
  // At x = -0.2 and 0.2 the faces lie.
  EXPECT_EQ(rings[0], 0U);
  EXPECT_EQ(rings[2], rings[4]);
  EXPECT_EQ(rings[3], rings[2] + 1);
  EXPECT_EQ(rings[6], 0U);
  EXPECT_GT(set.sightOf(3).backs, 0.99F);
  EXPECT_EQ(set.sightOf(0).backs, 0.0F);
  EXPECT_NEAR(found[3].light[0].x, 0.5F * (found[2].light[0].x + found[4].light[0].x), 1e-5F);
  EXPECT_GT(found[3].light[0].x, 1.0F);
}

TEST_F(Probes, TellHowFarSurfacesAre) {
  show(test::cubeQuads(4, test::kDark, test::kGrey));
  const auto now = light();
  const ProbeSet set(now, single({0.2, 0.0, 0.0}), 4096, 1);
  const auto& sight = set.sightOf(0);
  EXPECT_NEAR(sight.nearest, 0.3, 0.01);
  // About -X the wall is 0.7 away, about +X 0.3; of directions off the axis others are met.
  EXPECT_GT(sight.distance[1], sight.distance[0]);
  EXPECT_NEAR(sight.distance[2], sight.distance[3], 0.01) << "alike above and below";
  for (std::size_t lobe = 0; lobe < ProbeSight::kLobes; ++lobe)
    EXPECT_GE(sight.square[lobe], sight.distance[lobe] * sight.distance[lobe]);
}

TEST_F(Probes, CountWhatTheHalvesOfTheSolveDoNotTell) {
  const auto quad = lamp({30.0F, 20.0F, 10.0F});
  show({floor(), quad});
  const glm::dvec3 place(0.2, -0.1, 0.15);
  const auto now = light();
  const auto found = ProbeSet(now, single(place), kRays, 1).light(now, 0.1).front();
  double square = 0.0;
  for (const auto& of : found.light) square += std::pow(of.x, 2.0) / kHarmonics;
  for (std::size_t h = 0; h < kHarmonics; ++h) {
    const double least = std::max(std::sqrt(square), std::abs(double{found.light[h].x}));
    EXPECT_NEAR(found.error[h].x, 0.1 * least, 1e-4 * least) << h << ": else nothing is off";
  }
}

// Each ray ends in the sky or on the floor.
TEST_F(Probes, CastFewerRaysWhereTheyWouldHaveTooManyEnds) {
  sources_.sky.upper = sources_.sky.lower = glm::vec3(10.0F);
  const std::array places{glm::dvec3(0.0, 0.2, 0.0)};
  const auto now = light();
  const auto radiance = ProbeRays::radianceOf(now);
  const auto lightOf = [&](std::uint32_t rays, std::size_t most_ends) {
    const ProbeRays made(now, places, rays, 1, most_ends);
    EXPECT_TRUE(made.areWithinBounds());
    return made.gather(0, radiance).mean;
  };
  EXPECT_EQ(lightOf(256, 255), lightOf(128, 256));
  EXPECT_EQ(lightOf(256, 256), lightOf(256, 1000));
  EXPECT_FALSE(ProbeRays(now, places, 256, 1, 30).areWithinBounds());
}

TEST(ProbeFill, OfAGridWithoutAnyMeasuredProbeIsBlack) {
  std::vector<ProbeLight> probes(8);
  for (auto& probe : probes) probe.ring = ProbeLight::kUnfilled;
  fillProbes({{}, {glm::dvec3(1, 0, 0), {0, 1, 0}, {0, 0, 1}}, {2, 2, 2}}, probes);
  for (const auto& probe : probes) {
    EXPECT_EQ(probe.ring, ProbeLight::kUnfilled);
    EXPECT_EQ(probe.light[0], glm::vec3(0.0F));
  }
}

TEST(ProbeFill, GoesOutwardFromTheMeasuredAndCountsTheNearestMost) {
  std::vector<ProbeLight> probes(5);
  for (auto& probe : probes) probe.ring = ProbeLight::kUnfilled;
  probes[0].ring = 0;
  probes[0].light[0] = glm::vec3(8.0F);
  probes[0].error[0] = glm::vec3(0.5F);
  fillProbes({{}, {glm::dvec3(1, 0, 0), {0, 1, 0}, {0, 0, 1}}, {5, 1, 1}}, probes);
  for (std::uint32_t i = 0; i < 5; ++i) {
    EXPECT_EQ(probes[i].ring, i);
    EXPECT_EQ(probes[i].light[0], glm::vec3(8.0F));
    EXPECT_EQ(probes[i].error[0], glm::vec3(0.5F)) << "as uncertain as what it is filled from";
  }
}

TEST(ProbeRaysOfAProbe, AreFewerWhereThereAreManyProbes) {
  EXPECT_EQ(ProbeSet::raysFor(1), 256U);
  EXPECT_EQ(ProbeSet::raysFor(65'536), 256U);
  EXPECT_EQ(ProbeSet::raysFor(100'000), 128U);
  EXPECT_EQ(ProbeSet::raysFor(262'144), 64U);
}

}  // namespace
}  // namespace radiosity::solver
