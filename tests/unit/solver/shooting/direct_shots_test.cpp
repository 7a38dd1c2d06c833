// Direct light of many lamps where links are forgotten: what a round sends, and that waves stay short.
#include "server/solver/shooting/direct_shots.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <map>
#include <vector>

namespace radiosity::solver {
namespace {

constexpr std::size_t kLeaves = 16'000;

std::vector<LightPolygon> lamps(std::uint32_t count, float first_emission = 1.0F) {
  std::vector<LightPolygon> lights;
  for (std::uint32_t i = 0; i < count; ++i) {
    const auto x = static_cast<float>(i);
    LightPolygon light;
    light.corners = {glm::vec3(x, 0.0F, 0.0F), {x + 1.0F, 0.0F, 0.0F}, {x, 0.0F, 1.0F}};
    light.normal = {0.0F, -1.0F, 0.0F};
    light.emission = glm::vec3(i == 0 ? first_emission : 1.0F);
    light.area = 0.5;
    light.key = 2 * i;
    lights.push_back(light);
  }
  return lights;
}

struct Round {
  std::size_t waves = 0, points = 0, most_points = 0;
  std::array<double, 3> flux{};
};

Round shoot(DirectShots& shots, std::uint32_t round) {
  Round done;
  shots.startRound(round);
  while (shots.isDue()) {
    const auto batch = shots.next(done.flux);
    ++done.waves;
    done.points += batch.points.size();
    done.most_points = std::max(done.most_points, batch.points.size());
  }
  EXPECT_EQ(shots.owed(), 0.0);
  return done;
}

TEST(DirectShots, EachOfFewLampsSendsAllThatItEmitsInEachRound) {
  DirectShots shots({}, kLeaves);
  shots.take(lamps(200));
  for (std::uint32_t round = 1; round < 4; ++round) {
    EXPECT_NEAR(shoot(shots, round).flux[1], 100.0, 1e-9);
    for (const auto& light : shots.lights())
      EXPECT_EQ(light.delivered[0], static_cast<double>(round) * glm::dvec3(light.emission));
  }
}

TEST(DirectShots, ARoundOfThousandsOfLampsIsNoMoreWorkThanOneOfHundreds) {
  DirectShots few({}, kLeaves), many({}, kLeaves);
  few.take(lamps(256));
  many.take(lamps(4096));
  EXPECT_LE(shoot(many, 1).points, shoot(few, 1).points);
}

// Whatever shoots stands for all that do not: their light is there from the first round on.
TEST(DirectShots, ThoseWhoseTurnItIsSendForAll) {
  constexpr std::uint32_t kLamps = 4096, kCycle = 32;
  DirectShots shots({}, kLeaves);
  shots.take(lamps(kLamps));
  for (std::uint32_t round = 1; round <= kCycle; ++round) EXPECT_NEAR(shoot(shots, round).flux[0], 0.5 * kLamps, 1e-6);
  for (const auto& light : shots.lights()) {
    for (const auto& of_half : light.delivered) EXPECT_EQ(of_half, static_cast<double>(kCycle) * glm::dvec3(1.0));
  }
}

TEST(DirectShots, TheHalvesTakeDifferentLamps) {
  DirectShots shots({}, kLeaves);
  shots.take(lamps(4096));
  (void)shoot(shots, 1);
  const auto alike = std::ranges::count_if(shots.lights(), [](const ShotLight& light) {
    return light.delivered[0] != glm::dvec3(0.0) && light.delivered[1] != glm::dvec3(0.0);
  });
  EXPECT_LT(alike, 16);  // by chance 4 of the 128 that shoot in a half shoot in both
}

TEST(DirectShots, AStrongLampAmongThousandsShootsInEachRound) {
  DirectShots shots({}, kLeaves);
  shots.take(lamps(4096, 1000.0F));
  for (std::uint32_t round = 1; round < 4; ++round) {
    (void)shoot(shots, round);
    EXPECT_EQ(shots.lights()[0].delivered[0].x, 1000.0 * round);
  }
}

TEST(DirectShots, LampsThatAreSwitchedOffTakeBackWhatTheySent) {
  DirectShots shots({}, kLeaves);
  shots.take(lamps(4096));
  const auto sent = shoot(shots, 1);
  shots.take({});
  const auto taken = shoot(shots, 1);
  EXPECT_EQ(taken.points, sent.points);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(taken.flux[c], -sent.flux[c], 1e-9);
  EXPECT_NEAR(shoot(shots, 2).flux[0], 0.0, 1e-12);
}

// A limit of time waits for the wave under way.
TEST(DirectShots, AWaveIsShortHoweverManyLeavesLook) {
  std::map<std::size_t, Round> by_leaves;
  for (const std::size_t leaves : {1'000, 500'000, 4'000'000}) {
    DirectShots shots({}, leaves);
    shots.take(lamps(4096, 1000.0F));
    by_leaves[leaves] = shoot(shots, 1);
    EXPECT_LE(by_leaves[leaves].most_points * leaves, 20'000'000U) << leaves;
    EXPECT_NEAR(by_leaves[leaves].flux[0], by_leaves[1'000].flux[0], 1e-6) << leaves;
  }
  EXPECT_GT(by_leaves[500'000].waves, 10U);
}

}  // namespace
}  // namespace radiosity::solver
