// Lengths and light of any size, and scenes far from the origin.
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "tests/accuracy/stress/stress_solve.h"

namespace radiosity::accuracy {
namespace {

constexpr std::uint64_t kRoomTexels = 1500;

Loaded withLight(double factor) {
  auto scene = litRoom();
  for (auto& material : scene.materials) material.emission_nits *= factor;
  return load(scene, kRoomTexels);
}

TEST(Scale, OfLengthsByAPowerOfTwoChangesNoBit) {
  Solve one(load(litRoom(), kRoomTexels));
  one.run();
  for (const int power : {-26, 26}) {
    Solve scaled(load(litRoom(std::ldexp(1.0, power)), kRoomTexels));
    scaled.run();
    EXPECT_EQ(scaled.solver().irradiance(), one.solver().irradiance()) << power;
    EXPECT_EQ(scaled.solver().shots(), one.solver().shots()) << power;
  }
}

TEST(Scale, OfLengthsFromATenMillionthToATenMillionGivesTheSameAnswer) {
  Solve one(load(litRoom(), kRoomTexels));
  one.run();
  for (const double scale : {1e-8, 1e-4, 1e4, 1e8}) {
    Solve scaled(load(litRoom(scale), kRoomTexels));
    EXPECT_TRUE(scaled.run());
    expectSound(scaled);
    // The corners in the file are rounded to floats: 6e-8, which moves some pixels of the hemicubes' images across an
    // edge. What that does is less than what another seed would do.
    EXPECT_LT(largestDifference(one, scaled), 0.01) << scale;
    // A draw of roulette that close may fall to the other side: then what that node sends is unshot.
    const auto found = scaled.solver().energy(), wanted = one.solver().energy();
    EXPECT_NEAR((found.absorbed[0] + found.unshot[0]) / (wanted.absorbed[0] + wanted.unshot[0]), 1.0, 1e-4) << scale;
  }
}

TEST(Scale, OfLightByAPowerOfTwoChangesNoBitButTheExponent) {
  Solve one(withLight(1.0));
  one.run();
  for (const int power : {-26, 26}) {
    Solve scaled(withLight(std::ldexp(1.0, power)));
    scaled.run();
    EXPECT_EQ(scaled.solver().shots(), one.solver().shots()) << power;
    EXPECT_EQ(largestDifference(one, scaled, std::ldexp(1.0, -power)), 0.0) << power;
  }
}

TEST(Scale, OfLightFromATenMillionthToATenMillionGivesTheSameAnswer) {
  Solve one(withLight(1.0));
  one.run();
  for (const double scale : {1e-8, 1e8}) {
    Solve scaled(withLight(scale));
    EXPECT_TRUE(scaled.run());
    expectSound(scaled);
    EXPECT_LT(largestDifference(one, scaled, 1.0 / scale), 1e-4) << scale;
  }
}

TEST(Offset, OfAMillionTimesTheSizeGivesTheSameAnswer) {
  Solve near(load(litRoom(), kRoomTexels));
  near.run();
  // Not a number with few digits, which would leave the corners' low bits alone.
  Solve far(load(litRoom(1.0, {2.5e6 + 0.1, -1.7e6 - 0.3, 3.1e6 + 0.7}), kRoomTexels));
  EXPECT_TRUE(far.run());
  expectSound(far);
  EXPECT_EQ(far.solver().shots(), near.solver().shots());
  EXPECT_LT(largestDifference(near, far), 1e-4);
}

}  // namespace
}  // namespace radiosity::accuracy
