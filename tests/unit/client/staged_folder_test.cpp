#include "client/cli/staged_folder.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>

#include "common/bytes.h"
#include "tests/unit/client/temporary_folder.h"

namespace radiosity::cli {
namespace {

const Bytes kText = {'n', 'e', 'w'};

TEST(StagedFolder, putsFilesInPlaceAtCommitAndNoOthers) {
  const TemporaryFolder parent;
  parent.write("out/a", "old");
  parent.write("out/mine", "mine");
  {
    auto folder = StagedFolder::open(parent.file("out"));
    ASSERT_TRUE(folder) << folder.error().text();
    for (const auto* name : {"a", "b", "c"}) ASSERT_TRUE(folder->write(name, kText));
    EXPECT_EQ(parent.read("out/a"), "old");
    const auto paths = folder->commit({"b", "a"});
    ASSERT_TRUE(paths) << paths.error().text();
    EXPECT_THAT(*paths, testing::ElementsAre(parent.file("out/b"), parent.file("out/a")));
  }
  EXPECT_EQ(parent.read("out/a"), "new");
  EXPECT_EQ(parent.read("out/b"), "new");
  EXPECT_EQ(parent.read("out/mine"), "mine");
  EXPECT_FALSE(std::filesystem::exists(parent.file("out/c")));
}

TEST(StagedFolder, leavesNoFolderOfItsOwnWithoutCommit) {
  const TemporaryFolder parent;
  {
    auto folder = StagedFolder::open(parent.file("out"));
    ASSERT_TRUE(folder);
    ASSERT_TRUE(folder->write("a", kText));
  }
  EXPECT_EQ(parent.count(), 0U);
}

TEST(StagedFolder, namesAFileThatDidNotFitByItsLaterPlace) {
  const TemporaryFolder parent;
  parent.write("out/a", "old");
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = signal(SIGXFSZ, SIG_IGN);
  {
    auto folder = StagedFolder::open(parent.file("out"));
    ASSERT_TRUE(folder);
    const rlimit small{1, before.rlim_max};
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    const auto written = folder->write("a", kText);
    setrlimit(RLIMIT_FSIZE, &before);
    ASSERT_FALSE(written);
    EXPECT_EQ(written.error().where, parent.file("out/a"));
  }
  signal(SIGXFSZ, handler);
  EXPECT_EQ(parent.read("out/a"), "old");
}

TEST(StagedFolder, movesNothingWhereOneFileIsMissing) {
  const TemporaryFolder parent;
  parent.write("out/a", "old");
  auto folder = StagedFolder::open(parent.file("out"));
  ASSERT_TRUE(folder);
  ASSERT_TRUE(folder->write("a", kText));
  const auto paths = folder->commit({"a", "b"});
  ASSERT_FALSE(paths);
  EXPECT_EQ(paths.error().where, parent.file("out/b"));
  EXPECT_EQ(parent.read("out/a"), "old");
}

TEST(StagedFolder, sweepsWhatNobodyHoldsAnyMore) {
  const TemporaryFolder parent;
  parent.write("out/.radiosity-abcdef/a", "left");
  parent.write("out/.radiosity-file", "mine");
  const auto first = StagedFolder::open(parent.file("out"));
  ASSERT_TRUE(first);
  EXPECT_FALSE(std::filesystem::exists(parent.file("out/.radiosity-abcdef")));
  EXPECT_EQ(parent.read("out/.radiosity-file"), "mine");
  ASSERT_TRUE(first->write("a", kText));
  const auto second = StagedFolder::open(parent.file("out"));
  ASSERT_TRUE(second);
  EXPECT_TRUE(std::filesystem::exists(first->stagedPath("a")));
}

}  // namespace
}  // namespace radiosity::cli
