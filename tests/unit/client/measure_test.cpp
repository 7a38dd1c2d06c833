#include "client/cli/measure.h"

#include <gmock/gmock.h>

namespace radiosity::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

protocol::Plane desk() {
  protocol::Plane plane;
  plane.node = 3;
  plane.columns = 6;
  plane.rows = 4;
  plane.illuminance.mean = 540.123;
  plane.illuminance.mean_error = 1.234;
  plane.illuminance.minimum = 480.0;
  plane.illuminance.uniformity = 0.8889;
  return plane;
}

TEST(PlanesText, TellsEachPlaneByNameOrNode) {
  auto named = desk();
  named.name = "desk";
  const auto text = planesText({1, "converged", 0.02, {desk(), named}});
  EXPECT_THAT(text, HasSubstr("node 3, 6 x 4 points: mean 540.1 +- 1.2 lux, minimum 480"));
  EXPECT_THAT(text, HasSubstr("\ndesk, 6 x 4 points"));
  EXPECT_THAT(text, HasSubstr("U0 0.889"));
  EXPECT_THAT(text, Not(HasSubstr("at 95 %")));
}

TEST(PlanesText, TellsWhatIsAskedForAndTheVerdict) {
  auto plane = desk();
  plane.wanted_lux = 500.0;
  plane.wanted_uniformity = 0.6;
  plane.verdict = {"passes", "undecided", "undecided"};
  EXPECT_THAT(planesText({1, "converged", 0.02, {plane}}),
              HasSubstr("500 lux: passes; U0 0.6: undecided; undecided at 95 %"));
}

TEST(PlanesText, TellsDaylightFactorsInPercent) {
  auto plane = desk();
  plane.daylight_factor = protocol::PlaneFigures{};
  plane.daylight_factor->mean = 2.25;
  EXPECT_THAT(planesText({1, "converged", 0.02, {plane}}), HasSubstr("daylight factor: mean 2.25"));
}

}  // namespace
}  // namespace radiosity::cli
