// The shelf of uploads.
#include "server/net/blob_store.h"

#include <gtest/gtest.h>

namespace radiosity::testing {
namespace {

using net::BlobStore;

SharedBytes bytesOf(char c, std::size_t size = 10) { return std::make_shared<const Bytes>(size, c); }

TEST(BlobStoreTest, WhatIsTakenBackLeavesTheShelfAsItWas) {
  BlobStore shelf(2, 100);
  const auto a = shelf.put("of a", "a", bytesOf('a')).id;
  const auto b = shelf.put("of b", "b", bytesOf('b')).id;
  const auto c = shelf.put("of c", "c", bytesOf('c'));
  ASSERT_EQ(c.dropped.size(), 1U);
  EXPECT_FALSE(shelf.find(a).has_value());
  shelf.takeBack(c);
  EXPECT_FALSE(shelf.find(c.id).has_value());
  ASSERT_TRUE(shelf.find(a).has_value());
  EXPECT_EQ(shelf.find(a)->name, "a");
  EXPECT_EQ(shelf.put("of c", "c", bytesOf('c')).dropped.at(0).id, a) << "the oldest, as before";
  EXPECT_TRUE(shelf.find(b).has_value());
}

TEST(BlobStoreTest, WhatLayThereBeforeStaysWhenItsSecondCopyIsTakenBack) {
  BlobStore shelf(2, 100);
  const auto first = shelf.put("of a", "a", bytesOf('a'));
  EXPECT_FALSE(first.was_there);
  const auto again = shelf.put("of a", "a", bytesOf('a'));
  EXPECT_TRUE(again.was_there);
  shelf.takeBack(again);
  EXPECT_TRUE(shelf.find(first.id).has_value());
}

}  // namespace
}  // namespace radiosity::testing
