#include "server/state/database.h"

#include <gtest/gtest.h>

#include <new>

#include "tests/unit/client/temporary_folder.h"

namespace radiosity::state {
namespace {

TEST(Database, WorkThatRunsOutOfMemoryLeavesNoTransactionOpen) {
  const TemporaryFolder folder;
  auto database = Database::open(folder.file("a.sqlite"));
  ASSERT_TRUE(database) << database.error().text();
  ASSERT_TRUE(database->run("CREATE TABLE a(b)"));
  const auto work = [&]() -> Result<void> {
    if (auto put = database->run("INSERT INTO a VALUES(1)"); !put) return put;
    throw std::bad_alloc();
  };
  EXPECT_THROW((void)database->atomically(work), std::bad_alloc);
  const auto next = database->atomically([&] { return database->run("INSERT INTO a VALUES(2)"); });
  ASSERT_TRUE(next) << next.error().text();
  const auto rows = database->rows("SELECT b FROM a");
  ASSERT_TRUE(rows);
  ASSERT_EQ(rows->size(), 1U) << "nothing of the work that failed";
  EXPECT_EQ(std::get<std::int64_t>((*rows)[0][0]), 2);
}

}  // namespace
}  // namespace radiosity::state
