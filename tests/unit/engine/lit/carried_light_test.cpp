// How light that was there before gives way to new light.
#include "server/engine/lit/carried_light.h"

#include <gtest/gtest.h>

namespace radiosity::engine {
namespace {

TEST(CarriedLight, OfAnEditGoesAsTheNewLightComesNearItsTarget) {
  EXPECT_EQ(newLightShare(1.0, 0.02), 0.0);
  EXPECT_EQ(newLightShare(0.05, 0.02), 1.0);
  EXPECT_GT(newLightShare(0.1, 0.02), newLightShare(0.2, 0.02));
  EXPECT_EQ(newLightShare(0.09, 0.1), 1.0) << "as good as was asked for";
}

// What is off by 4 % is not to give way to what is off by 20 %, however soon that comes.
TEST(CarriedLight, OfCoarserTexelsStaysUntilThatOfFinerOnesIsAsGood) {
  constexpr double kOld = 0.04;
  EXPECT_EQ(refinedLightShare(0.2, kOld), 0.0);
  EXPECT_EQ(refinedLightShare(2.0 * kOld, kOld), 0.0);
  const double half = refinedLightShare(1.5 * kOld, kOld);
  EXPECT_GT(half, 0.0);
  EXPECT_LT(half, 1.0);
  EXPECT_EQ(refinedLightShare(kOld, kOld), 1.0);
  EXPECT_EQ(refinedLightShare(0.0, kOld), 1.0);
}

}  // namespace
}  // namespace radiosity::engine
