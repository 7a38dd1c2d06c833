#include "common/shared_list.h"

#include <gtest/gtest.h>

#include <memory>
#include <vector>

namespace radiosity {
namespace {

TEST(SharedList, CopiesShareWhatNoneOfThemEdits) {
  SharedList<std::vector<int>> list{{1}, {2, 3}};
  const auto before = list;
  list.edit(1, [](std::vector<int>& value) { value.push_back(4); });
  list.push_back(std::vector<int>{5});
  EXPECT_EQ(list.element(0), before.element(0));
  EXPECT_EQ(before[1], (std::vector<int>{2, 3}));
  EXPECT_EQ(list[1], (std::vector<int>{2, 3, 4}));
  EXPECT_EQ(before.size(), 2U);
  EXPECT_EQ(list.back(), std::vector<int>{5});
}

TEST(SharedList, IsEqualByValueHoweverItIsShared) {
  const SharedList<int> list{1, 2};
  auto copy = list;
  EXPECT_EQ(copy, list);
  EXPECT_EQ((SharedList<int>{1, 2}), list);
  copy.edit(0, [](int& value) { value = 3; });
  EXPECT_NE(copy, list);
  EXPECT_NE((SharedList<int>{1}), list);
}

TEST(SharedList, IsGoneThroughInOrder) {
  SharedList<int> list;
  EXPECT_TRUE(list.empty());
  const auto held = std::make_shared<const int>(7);
  list.push_back(held);
  list.push_back(8);
  EXPECT_EQ(std::vector<int>(list.begin(), list.end()), (std::vector<int>{7, 8}));
  EXPECT_EQ(list.element(0), held);
  EXPECT_THROW((void)list.at(2), std::out_of_range);
}

}  // namespace
}  // namespace radiosity
