// Numbers in as few bytes as they need: what is set is what is read, whatever lies beside it.
#include "common/packed_numbers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <random>
#include <vector>

namespace radiosity {
namespace {

TEST(PackedNumbers, TakeAsManyBytesAsTheLargestNeeds) {
  EXPECT_EQ(PackedNumbers::widthFor(0), 2U);
  EXPECT_EQ(PackedNumbers::widthFor(0xFFFF), 2U);
  EXPECT_EQ(PackedNumbers::widthFor(0x1'0000), 3U);
  EXPECT_EQ(PackedNumbers::widthFor(0xFF'FFFF), 3U);
  EXPECT_EQ(PackedNumbers::widthFor(0x100'0000), 4U);
  EXPECT_LE(PackedNumbers(1000, 0x1'0000).bytes(), 3008U);
}

TEST(PackedNumbers, AreWhatTheyWereSetTo) {
  std::mt19937 random(1);
  for (const std::uint32_t most : {0xFFFFU, 0xFF'FFFFU, 0xFFFF'FFFFU}) {
    PackedNumbers packed(1000, most);
    EXPECT_EQ(packed.most(), most);
    std::vector<std::uint32_t> plain(1000, most);
    for (int i = 0; i < 5000; ++i) {
      const auto at = random() % 1000;
      plain[at] = static_cast<std::uint32_t>(random()) & most;
      packed.set(at, plain[at]);
    }
    EXPECT_TRUE(std::ranges::equal(packed.all(), plain));
    for (std::size_t i = 0; i < plain.size(); ++i) ASSERT_EQ(packed[i], plain[i]) << i << " of " << most;
    const auto run = packed.run(990, 10);
    ASSERT_EQ(run.size(), 10U);
    for (std::size_t i = 0; i < 10; ++i) EXPECT_EQ(run[i], plain[990 + i]);
  }
}

TEST(PackedNumbers, OfNoneThereIsNone) {
  const PackedNumbers none;
  EXPECT_EQ(none.size(), 0U);
  EXPECT_EQ(std::ranges::distance(none.all()), 0);
}

}  // namespace
}  // namespace radiosity
