// Daylight against what is published of it: almanacs, closed forms of the CIE's skies.
#include "server/scene/values/daylight.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/unit/scene/values/degree.h"

namespace radiosity::scene {
namespace {

using std::numbers::pi;
using test::kDegree;

/// Altitude and azimuth, degrees.
std::pair<double, double> sunOf(const char* time, double latitude, double longitude) {
  const auto moment = momentOf(time);
  EXPECT_TRUE(moment) << time;
  const auto sun = sunAt(moment.value_or(Moment{}), latitude, longitude);
  return {sun.altitude / kDegree, sun.azimuth / kDegree};
}

/// What a plane of this normal receives of all that is above the horizon.
double arrives(const SkyImage& sky, const glm::dvec3& normal) {
  double sum = 0.0;
  for (std::size_t y = 0; y < sky.height / 2; ++y) {
    for (std::size_t x = 0; x < sky.width; ++x) {
      const double polar = (static_cast<double>(y) + 0.5) / static_cast<double>(sky.height) * pi;
      const double azimuth = (2.0 * (static_cast<double>(x) + 0.5) / static_cast<double>(sky.width) - 1.0) * pi;
      const glm::dvec3 d(std::sin(polar) * std::cos(azimuth), std::cos(polar), std::sin(polar) * std::sin(azimuth));
      sum +=
          std::max(0.0, glm::dot(normal, d)) * std::sin(polar) * static_cast<double>(sky.texels[y * sky.width + x].x);
    }
  }
  return sum * 2.0 * pi * pi / static_cast<double>(sky.width * sky.height);
}

// Meeus, "Astronomical Algorithms", chapter 13 ff., and the equinoxes and solstices of almanacs.
TEST(Sun, StandsWhereAlmanacsHaveIt) {
  // At the summer solstice, at noon of the sun, as far from the zenith as the latitude is from the tropic.
  const auto [summer, south] = sunOf("2026-06-21T12:16:00+01:00", 48.1, 11.6);  // 12:15.6 is noon there
  EXPECT_NEAR(summer, 90.0 - 48.1 + 23.44, 0.05);
  EXPECT_NEAR(std::abs(south), 180.0, 0.5);
  const auto [equinox, noon] = sunOf("2024-03-20T12:07:27Z", 0.0, 0.0);
  EXPECT_GT(equinox, 89.8);
  (void)noon;
  const auto [winter, azimuth] = sunOf("2000-12-21T11:58:00Z", 51.48, 0.0);
  EXPECT_NEAR(winter, 90.0 - 51.48 - 23.44 + 0.06, 0.05) << "with what the air bends it";
  EXPECT_NEAR(std::abs(azimuth), 180.0, 0.5);
  const auto [morning, east] = sunOf("2024-03-20T06:07:27Z", 0.0, 0.0);
  EXPECT_NEAR(morning, 0.5, 0.3);
  EXPECT_NEAR(east, 90.0, 0.2);
  // NREL SPA report (Reda and Andreas 2004), A.5: zenith 50.11162, azimuth 194.34024 (there at 1830 m).
  const auto [golden, spa] = sunOf("2003-10-17T12:30:30-07:00", 39.742476, -105.1786);
  EXPECT_NEAR(golden, 90.0 - 50.11162, 0.02);
  EXPECT_NEAR(spa, 194.34024 - 360.0, 0.02);
}

TEST(Sun, EastIsXAndNorthIsMinusZ) {
  const SunPlace rising{0.0, 90.0 * kDegree}, south{30.0 * kDegree, 180.0 * kDegree};
  EXPECT_LT(glm::distance(rising.direction(), glm::dvec3(1, 0, 0)), 1e-9);
  EXPECT_LT(glm::distance(south.direction(), glm::dvec3(0, 0.5, std::sqrt(0.75))), 1e-9);
}

TEST(Sun, OfTimesThatAreNoneIsNotTold) {
  for (const char* wrong : {"", "2026-06-21", "2026-13-01T00:00Z", "2026-02-29T00:00Z", "2026-06-21T24:00Z",
                            "2026-06-21T12:00", "2026-06-21T12:00+2:00", "1900-01-01T00:00Z", "2026-06-21T12:00:61Z",
                            "-026-06-21T12:00Z", "2026-06-21T12:00+02:00x", "2026-06-21 12:00Z"})
    EXPECT_FALSE(momentOf(wrong)) << wrong;
  EXPECT_NEAR(momentOf("2000-01-01T12:00Z")->days, 0.0, 1e-9);
  EXPECT_NEAR(momentOf("2024-02-29T14:00+02:00")->days, 8825.0, 1e-9);
  EXPECT_EQ(momentOf("2024-12-31T00:00:30Z")->day_of_year, 366);
}

TEST(CieSky, OvercastBringsSevenNinthsOfPi) {
  const auto sky = daylightImage(cieShape(kCieOvercast), {0, 1, 0}, 1000.0, 0.0);
  const double zenith = static_cast<double>(sky.texels[0].x);
  EXPECT_NEAR(1000.0, 7.0 / 9.0 * pi * zenith, 1.0);
  EXPECT_NEAR(arrives(sky, {0, 1, 0}), 1000.0, 0.5);
  // Moon and Spencer: a wall gets (pi / 6 + 4 / 9) Lz, 0.396 of the ground.
  EXPECT_NEAR(arrives(sky, {1, 0, 0}), (pi / 6.0 + 4.0 / 9.0) * zenith, 0.5);
  EXPECT_NEAR(arrives(sky, {1, 0, 0}) / 1000.0, 0.396, 0.001);
}

TEST(CieSky, TypesAreTheStandards) {
  EXPECT_EQ(cieShape(5).at({0, 1, 0}, {0, 1, 0}), cieShape(5).at({1, 0, 0}, {0, 1, 0})) << "uniform";
  const auto overcast = cieShape(1);  // a third at the horizon, nearly
  EXPECT_NEAR(overcast.at({1, 0, 0}, {0, 1, 0}) / overcast.at({0, 1, 0}, {0, 1, 0}), 1.0 / (1.0 + 4.0 * std::exp(-0.7)),
              1e-9);
  const glm::dvec3 sun = glm::normalize(glm::dvec3(1, 1, 0));
  const auto clear = cieShape(kCieClear);
  EXPECT_GT(clear.at(sun, sun), 5.0 * clear.at({-sun.x, sun.y, 0}, sun)) << "around the sun";
  EXPECT_GT(clear.at(glm::normalize(glm::dvec3(-1, 0.1, 0)), sun), clear.at({0, 1, 0}, sun) * 0.5) << "at the horizon";
  for (int type = 1; type <= kCieTypes; ++type)
    for (const auto& d : {glm::dvec3(0, 1, 0), glm::dvec3(1, 0, 0), sun})
      EXPECT_TRUE(std::isfinite(cieShape(type).at(d, sun)));
}

TEST(PerezSky, BringsWhatAClearDayDoes) {
  const double altitude = 60.0 * kDegree;
  const auto power = clearPower(3.0, altitude, 172);
  EXPECT_NEAR(power.direct, 930.0, 40.0) << "W/m^2 of a clear day";
  EXPECT_NEAR(power.diffuse, 110.0, 40.0);
  const auto sky = perezSky(power, altitude, 172);
  EXPECT_NEAR(sky.level.direct, 96'000.0, 5000.0);
  EXPECT_NEAR(sky.level.diffuse, 14'000.0, 5000.0);
  const SunPlace sun{altitude, pi};
  const auto image = daylightImage(sky.shape, sun.direction(), sky.level.diffuse, 100.0);
  EXPECT_NEAR(arrives(image, {0, 1, 0}), sky.level.diffuse, 0.005 * sky.level.diffuse);
  EXPECT_FLOAT_EQ(image.texels.back().x, 100.0F);
  for (const double diffuse : {1.0, 50.0, 400.0, 1000.0}) {
    for (const double direct : {0.0, 10.0, 300.0, 1000.0}) {
      for (const double degrees : {0.5, 5.0, 45.0, 89.5}) {
        const auto any = perezSky({diffuse, direct}, degrees * kDegree, 1);
        EXPECT_TRUE(std::isfinite(any.level.diffuse) && any.level.diffuse >= 0.0);
        const auto there = SunPlace{degrees * kDegree, 0.0}.direction();
        for (const auto& d : {glm::dvec3(0, 1, 0), glm::dvec3(1, 0, 0), there})
          EXPECT_TRUE(std::isfinite(any.shape.at(d, there)));
      }
    }
  }
}

}  // namespace
}  // namespace radiosity::scene
