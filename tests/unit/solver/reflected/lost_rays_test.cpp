#include "server/solver/reflected/lost_rays.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

namespace radiosity::solver {
namespace {

TEST(LostRays, AreWhatWasAddedHoweverManyThereAre) {
  std::mt19937 random(1);
  std::vector<LostRays::Counts> counts(1000);
  LostRays lost(counts.size());
  for (std::uint32_t v = 0; v < counts.size(); ++v) {
    if (v % 3 == 0) continue;  // loses none
    const std::uint32_t most = v % 7 == 0 ? 0xFFFF : v % 5 == 0 ? 0x100 : 8;
    for (auto* count : {&counts[v].above, &counts[v].below, &counts[v].absorbed, &counts[v].doubtful})
      *count = static_cast<std::uint16_t>(random() % (most + 1));
    if (v % 11 == 0) counts[v].below = static_cast<std::uint16_t>(v % 2 == 0 ? 254 : 255);
    lost.add(v, counts[v]);
  }
  for (std::size_t v = 0; v < counts.size(); ++v) EXPECT_EQ(lost.at(v), counts[v]) << v;
  EXPECT_FALSE(lost.isNothing());
}

TEST(LostRays, OfAClosedRoomAreNothing) {
  LostRays lost(3);
  lost.add(1, {});
  EXPECT_TRUE(lost.isNothing());
  EXPECT_FALSE(lost.empty());
  EXPECT_TRUE(LostRays{}.empty());
  lost.add(2, {0, 0, 300, 0});
  EXPECT_FALSE(lost.isNothing());
}

}  // namespace
}  // namespace radiosity::solver
