#include "client/lib/atomic_file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>

#include "tests/unit/client/temporary_folder.h"

namespace radiosity::client {
namespace {

TEST(AtomicFile, appearsOnlyAtCommit) {
  const TemporaryFolder folder;
  auto file = AtomicFile::create(folder.file("a.bin"));
  ASSERT_TRUE(file);
  ASSERT_TRUE(file->write("hello "));
  ASSERT_TRUE(file->write("world"));
  EXPECT_FALSE(std::filesystem::exists(folder.file("a.bin")));
  ASSERT_TRUE(file->commit());
  EXPECT_EQ(folder.read("a.bin"), "hello world");
  EXPECT_EQ(folder.count(), 1U);
}

TEST(AtomicFile, leavesNothingBehindWithoutCommit) {
  const TemporaryFolder folder;
  folder.write("a.bin", "old");
  {
    auto file = AtomicFile::create(folder.file("a.bin"));
    ASSERT_TRUE(file);
    ASSERT_TRUE(file->write("new"));
  }
  EXPECT_EQ(folder.read("a.bin"), "old");
  EXPECT_EQ(folder.count(), 1U);
}

TEST(AtomicFile, movedFromFileDoesNotRemoveTheOther) {
  const TemporaryFolder folder;
  auto first = AtomicFile::create(folder.file("a.bin"));
  ASSERT_TRUE(first);
  ASSERT_TRUE(first->write("x"));
  AtomicFile second = std::move(*first);
  first = fail(ErrorCode::kInternal, "gone");
  ASSERT_TRUE(second.commit());
  EXPECT_EQ(folder.read("a.bin"), "x");
}

TEST(AtomicFile, getsThePermissionsOfAnyNewFile) {
  const TemporaryFolder folder;
  const mode_t old_mask = umask(022);
  auto file = AtomicFile::create(folder.file("a.bin"));
  umask(old_mask);
  ASSERT_TRUE(file && file->commit());
  struct stat info {};
  ASSERT_EQ(stat(folder.file("a.bin").c_str(), &info), 0);
  EXPECT_EQ(info.st_mode & 0777U, 0644U);
}

TEST(AtomicFile, writesThroughASymbolicLink) {
  const TemporaryFolder folder;
  folder.write("real.bin", "old");
  std::filesystem::create_symlink("real.bin", folder.file("link.bin"));
  auto file = AtomicFile::create(folder.file("link.bin"));
  ASSERT_TRUE(file && file->write("new") && file->commit());
  EXPECT_EQ(folder.read("real.bin"), "new");
  EXPECT_TRUE(std::filesystem::is_symlink(folder.file("link.bin")));
}

TEST(AtomicFile, refusesAFolderAndAMissingFolderByName) {
  const TemporaryFolder folder;
  const auto is_folder = AtomicFile::create(folder.file(""));
  ASSERT_FALSE(is_folder);
  EXPECT_EQ(is_folder.error().code, ErrorCode::kBadUsage);
  const auto missing = AtomicFile::create(folder.file("no/such/a.bin"));
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().code, ErrorCode::kBadUsage);
  EXPECT_NE(missing.error().text().find("does not exist"), std::string::npos);
  const auto device = AtomicFile::create("/dev/null");
  ASSERT_FALSE(device);
  EXPECT_NE(device.error().text().find("not a regular file"), std::string::npos);
}

TEST(AtomicFile, tellsWhenTheDiskRefusesMore) {
  const TemporaryFolder folder;
  rlimit old_limit{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &old_limit), 0);
  auto* const old_handler = std::signal(SIGXFSZ, SIG_IGN);
  rlimit limit = old_limit;
  limit.rlim_cur = 1000;
  auto file = AtomicFile::create(folder.file("a.bin"));
  ASSERT_TRUE(file);
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  const auto written = file->write(std::string(5000, 'x'));
  setrlimit(RLIMIT_FSIZE, &old_limit);
  std::signal(SIGXFSZ, old_handler);
  ASSERT_FALSE(written);
  EXPECT_NE(written.error().text().find("after 1000 bytes"), std::string::npos) << written.error().text();
  EXPECT_FALSE(std::filesystem::exists(folder.file("a.bin")));
}

}  // namespace
}  // namespace radiosity::client
