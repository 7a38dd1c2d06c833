// How many places of a leaf are asked whether they are buried: all of them unless that costs too much.
#include "server/scene/burial/burial_budget.h"

#include <gtest/gtest.h>

#include <vector>

#include "server/scene/burial/coverage.h"

namespace radiosity::scene {
namespace {

std::vector<TriedLeaf> alike(std::uint64_t work, bool buried, bool visible) {
  return std::vector<TriedLeaf>(100, TriedLeaf{TriedLeaf::kPlaces * work, buried, visible});
}

void expectPlaces(const BurialPlaces& places, std::uint32_t few, std::uint32_t many) {
  EXPECT_EQ(places.few, few);
  EXPECT_EQ(places.many, many);
  EXPECT_EQ(places.beside, many);
}

TEST(BurialBudget, WhatIsCheapIsAskedOfAllPlaces) {
  expectPlaces(affordablePlaces(0, {}), 16, 64);
  expectPlaces(affordablePlaces(10'000, alike(1000, true, false)), 16, 64);
  expectPlaces(affordablePlaces(1000, alike(2500, true, true)), 16, 64);
  EXPECT_TRUE(affordablePlaces(1000, alike(2500, true, true)).finer);
  EXPECT_TRUE(budgetWarning({}, 0).empty());
}

// (16 + 64) x 4,000 x 1,000 is within the budget, and with 50 more it is not.
TEST(BurialBudget, EdgesAreNotLookedAtMoreCloselyWhereThatCostsTooMuch) {
  expectPlaces(affordablePlaces(1000, alike(4000, true, true)), 16, 64);
  EXPECT_FALSE(affordablePlaces(1000, alike(4000, true, true)).finer);
}

TEST(BurialBudget, FewerPlacesAreAskedWhereEachCostsMore) {
  expectPlaces(affordablePlaces(10'000, alike(5000, true, false)), 8, 32);
  expectPlaces(affordablePlaces(10'000, alike(5000, true, true)), 1, 4);
  expectPlaces(affordablePlaces(16'000, alike(1'000'000'000, true, true)), 1, 1);
  EXPECT_NE(budgetWarning({8, 32, 32}, 0).find("only 8 places"), std::string::npos);
}

// Only as many as are spread well: five of a leaf once lay in one row.
TEST(BurialBudget, VeryManyLeavesGetAPowerOfTwo) {
  expectPlaces(affordablePlaces(125'000, {}), 16, 64);
  expectPlaces(affordablePlaces(130'000, {}), 8, 64);
  expectPlaces(affordablePlaces(367'000, {}), 4, 64);
  expectPlaces(affordablePlaces(5'000'000, {}), 1, 64);
  EXPECT_FALSE(budgetWarning({4, 64, 64}, 0).empty());
}

// Also where leaves are many: few places miss what lies along an edge.
TEST(BurialBudget, BesideEdgesMoreIsAskedAsLongAsItCanBePaidFor) {
  EXPECT_EQ(affordableBeside(125'000, {}, {}), 64U);
  EXPECT_EQ(affordableBeside(3000, {4, 64, 64}, {}), 64U);
  EXPECT_EQ(affordableBeside(250'000, {8, 64, 64}, {}), 32U);
  EXPECT_EQ(affordableBeside(1000, {}, alike(100'000, false, true)), 4U);
  EXPECT_EQ(affordableBeside(1000, {}, alike(100'000, true, true)), 64U) << "those beside are not buried";
}

// However dear a place is, all leaves together take no more than twice what is aimed at.
TEST(BurialBudget, PlacesThatStillCostTooMuchAreGivenUp) {
  EXPECT_EQ(affordablePlaces(10'000, alike(5000, true, true)).work_each, kMostWorkOfPlace);
  EXPECT_EQ(affordablePlaces(60'000, alike(800'000, true, true)).work_each, 4096U);
  EXPECT_EQ(affordablePlaces(10'000'000, alike(800'000, true, true)).work_each, 2000U);
  EXPECT_EQ(affordableWork(10), kMostWorkOfPlace);
  EXPECT_EQ(affordableWork(100'000), 2048U);
  EXPECT_NE(budgetWarning({1, 1, 1}, 17).find("17 sides of texels"), std::string::npos);
}

TEST(BurialBudget, LooksOfALeafAreFewerWhereThereAreMoreLeaves) {
  EXPECT_EQ(affordableLooks(0), 65'536U);
  EXPECT_EQ(affordableLooks(24'000), 4096U);
  EXPECT_EQ(affordableLooks(60'000), 2048U);
  EXPECT_EQ(affordableLooks(100'000'000), 512U);
}

TEST(BurialBudget, FewLeavesAreTried) {
  EXPECT_EQ(triedLeaves(0), 0U);
  EXPECT_LE(triedLeaves(3200), 100U);
  EXPECT_LE(triedLeaves(10'000'000), 1000U);
}

TEST(BurialBudget, PlacesOfEveryCountLieInColumnsAndRowsOfTheirOwn) {
  for (const std::uint32_t count : {1U, 2U, 4U, 8U, 16U, 32U, 64U}) {
    std::vector<bool> columns(count, false), rows(count, false);
    std::vector<int> quarters(4, 0);
    for (std::uint32_t i = 0; i < count; ++i) {
      const auto at = latticePoint(i, count);
      columns[static_cast<std::size_t>(at.x * count)] = true;
      rows[static_cast<std::size_t>(at.y * count)] = true;
      ++quarters[(at.x < 0.5 ? 0U : 1U) + (at.y < 0.5 ? 0U : 2U)];
    }
    EXPECT_EQ(columns, std::vector<bool>(count, true)) << count;
    EXPECT_EQ(rows, std::vector<bool>(count, true)) << count;
    if (count != 4 && count != 8) continue;
    for (const int in_quarter : quarters) EXPECT_EQ(in_quarter, static_cast<int>(count / 4)) << count;
  }
}

}  // namespace
}  // namespace radiosity::scene
