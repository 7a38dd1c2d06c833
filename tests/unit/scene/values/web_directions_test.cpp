// Directions that are drawn from photometric webs: as much light as the web has, where the web has it.
#include "server/scene/values/web_directions.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "server/scene/values/light_web.h"
#include "tests/unit/scene/values/degree.h"

namespace radiosity::scene {
namespace {

using std::numbers::pi;
using test::kDegree;

constexpr int kDraws = 1 << 16;

/// Means over draws.
struct Drawn {
  double weight = 0.0, cosine = 0.0, across = 0.0, least = 1e9, most = 0.0, outside = 0.0;
};

Drawn draw(const LightWeb& web, double beam_deg) {
  const WebDirections directions(web.table);
  Drawn mean;
  for (int i = 0; i < kDraws; ++i) {
    // As even as draws can be in either coordinate: the second is that of the golden ratio's multiples.
    const double golden = i * 0.6180339887498949;
    const auto one = directions.at({(i + 0.5) / kDraws, golden - std::floor(golden)});
    const double share = one.weight / kDraws;
    mean.weight += share;
    mean.cosine += share * std::cos(one.polar_rad);
    mean.across += share * std::sin(one.polar_rad) * std::cos(one.azimuth_rad);
    mean.least = std::min(mean.least, one.weight);
    mean.most = std::max(mean.most, one.weight);
    if (one.polar_rad > beam_deg * kDegree + 1e-9) mean.outside += 1.0;
  }
  return mean;
}

TEST(WebDirections, AllLieInABeamOfFiveDegreesAndBringItsLight) {
  std::vector<float> polar, candela;
  for (int i = 0; i <= 180; ++i) {
    polar.push_back(static_cast<float>(i));
    candela.push_back(i <= 2 ? 1000.0F : 0.0F);  // interpolated it ends at 3 degrees
  }
  const auto web = LightWeb::of(polar, {0.0F}, candela);
  const auto drawn = draw(web, 3.0);
  EXPECT_EQ(drawn.outside, 0.0) << "of directions all around one in 1500 lies in the beam";
  EXPECT_NEAR(drawn.weight, 1.0, 1e-3);
  EXPECT_LT(drawn.most, 2.2) << "where a cell goes from full to none it is twice its mean";
  // In degrees t, which are small: I = 1000 up to 2, then 1000 (3 - t). Integrals of I t^3 over those of I t.
  const double mean_square = (4.0 + (3.0 * 65.0 / 4.0 - 211.0 / 5.0)) / (2.0 + (3.0 * 5.0 / 2.0 - 19.0 / 3.0));
  EXPECT_NEAR(drawn.weight - drawn.cosine, 0.5 * mean_square * kDegree * kDegree, 2e-3 * kDegree * kDegree);
}

TEST(WebDirections, FollowTheAzimuthToo) {
  // 1 + cos(azimuth) over the lower half, in steps of 10 degrees: the mean of sin(polar) cos(azimuth) is pi / 8.
  std::vector<float> azimuth, candela;
  for (int a = 0; a <= 36; ++a) {
    azimuth.push_back(static_cast<float>(10 * a));
    for (int p = 0; p < 10; ++p) candela.push_back(static_cast<float>(1.0 + std::cos(10 * a * kDegree)));
  }
  const auto web = LightWeb::of({0, 10, 20, 30, 40, 50, 60, 70, 80, 90}, azimuth, candela);
  const auto drawn = draw(web, 90.0);
  EXPECT_NEAR(drawn.weight, 1.0, 1e-3);
  EXPECT_NEAR(drawn.cosine, 0.5, 1e-3);
  EXPECT_NEAR(drawn.across, pi / 8.0, 4e-3) << "interpolated, cosines are 0.25 % low";
}

TEST(WebDirections, OfADarkWebWeighNothing) {
  const auto web = LightWeb::of({0, 90}, {0.0F}, {0, 0});
  EXPECT_EQ(draw(web, 90.0).weight, 0.0);
}

}  // namespace
}  // namespace radiosity::scene
