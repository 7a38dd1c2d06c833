#include "server/engine/lit/texel_choice.h"

#include <gtest/gtest.h>

namespace radiosity::engine {
namespace {

solver::SurfaceErrorParts measured(double total, double p95) {
  solver::SurfaceErrorParts parts;
  parts.total = total;
  parts.p95 = p95;
  return parts;
}

TEST(AimAtSurface, IsTheTargetWhereMostPlacesAreWithinFiveTimesThat) {
  EXPECT_EQ(aimAtSurface(measured(0.019, 0.1), 0.02), 0.02);
  EXPECT_EQ(aimAtSurface(measured(0.3, 0.05), 0.02), 0.02);
}

TEST(AimAtSurface, IsLessAsFarAsPlacesAreFurtherOff) {
  EXPECT_NEAR(aimAtSurface(measured(0.02, 0.125), 0.02), 0.016, 1e-12);
  EXPECT_EQ(aimAtSurface(measured(0.04, 0.15), 0.02), 0.02) << "the total is further from what is asked";
}

// A lamp's own spot has most of the light of a dark hall, whose far end would be sampled for ever.
TEST(AimAtSurface, IsTheTargetWhereLessThanHalfOfItWouldBeNeeded) {
  EXPECT_EQ(aimAtSurface(measured(0.001, 0.9), 0.02), 0.02);
  EXPECT_EQ(aimAtSurface(measured(0.0, 0.9), 0.02), 0.02);
}

}  // namespace
}  // namespace radiosity::engine
