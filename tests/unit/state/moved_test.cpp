// A folder that goes away while a store has it open, and comes back, or does not.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <string>

#include "common/sha256.h"
#include "server/state/checkpoint.h"
#include "server/state/known_files.h"
#include "server/state/path_claim.h"
#include "server/state/store.h"
#include "tests/unit/client/temporary_folder.h"
#include "tests/unit/state/bytes_of.h"

namespace radiosity::state {
namespace {

namespace fs = std::filesystem;
using test::bytesOf;
using ::testing::HasSubstr;

Store::Change answeredChange(std::uint64_t revision) {
  Store::Change made{{revision, 1, "ann", "replace /a", 13.25, 0, "[]", {1, 0, {}, {}}}, {}, {}, 0, {}, {}};
  made.answer = Answer{"id-" + std::to_string(revision), 7, revision, 0, 0, 0};
  return made;
}

class Moved : public testing::Test {
 protected:
  void SetUp() override {
    store_ = open();
    ASSERT_TRUE(store_);
    ASSERT_TRUE(
        store_->load({1, 0, "", "room.glb", 12.5, 0, "", {}}, {"room.glb", "{}", {bytesOf("vertices")}, {}}, "d"));
  }
  std::unique_ptr<Store> open() {
    auto store = Store::open(state_);
    EXPECT_TRUE(store) << store.error().text();
    return store ? std::move(*store) : nullptr;
  }
  /// Nothing can be kept, and every refusal names `where`.
  void expectRefused(const std::string& where) {
    const auto upload = bytesOf("upload");
    const Result<void> refusals[] = {store_->check(), store_->edit(answeredChange(2)),
                                     store_->setSettings({{"seed", "5"}}),
                                     store_->keepUpload({sha256Hex(*upload), "u"}, upload, {})};
    for (const auto& refused : refusals) {
      ASSERT_FALSE(refused);
      EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
      EXPECT_EQ(refused.error().where, where);
    }
  }
  void expectKept(std::uint64_t revision) {
    store_.reset();
    store_ = open();
    ASSERT_TRUE(store_);
    const auto kept = store_->takeKept();
    ASSERT_FALSE(kept.revisions.empty());
    EXPECT_EQ(kept.revisions.back().revision, revision);
  }

  TemporaryFolder folder_;
  const fs::path state_ = folder_.file("state"), away_ = folder_.file("away");
  std::unique_ptr<Store> store_;
};

TEST_F(Moved, AFolderThatWasMovedAwayKeepsNothingUntilItIsBack) {
  fs::rename(state_, away_);
  expectRefused(state_ / "lock");
  fs::rename(away_, state_);
  EXPECT_TRUE(store_->check());
  const auto kept = store_->edit(answeredChange(2));
  ASSERT_TRUE(kept) << kept.error().text();
  expectKept(2);
}

TEST_F(Moved, AFolderThatWasRemovedOrReplacedKeepsNothing) {
  fs::copy(state_, away_, fs::copy_options::recursive);
  fs::remove_all(state_);
  expectRefused(state_ / "lock");
  fs::rename(away_, state_);  // the same files, other inodes
  expectRefused(state_ / "lock");
  EXPECT_THAT(store_->check().error().message, HasSubstr("another file"));
}

TEST_F(Moved, EachFileOfTheFolderIsMissed) {
  for (const auto* name : {"lock", "state.sqlite", "state.sqlite-wal", "blobs"}) {
    SCOPED_TRACE(name);
    fs::rename(state_ / name, folder_.file("one"));
    expectRefused(state_ / name);
    fs::rename(folder_.file("one"), state_ / name);
    EXPECT_TRUE(store_->check());
  }
}

// SQLite removes its log by name when it closes, and the other's blobs are not known to the first.
TEST_F(Moved, AnotherStoreAtThePathIsLeftAlone) {
  fs::rename(state_, away_);
  auto other = open();
  ASSERT_TRUE(other) << "the first one no longer holds the path";
  ASSERT_TRUE(other->load({1, 0, "", "hall.glb", 1.0, 0, "", {}}, {"hall.glb", "{}", {bytesOf("other")}, {}}, "e"));
  expectRefused(state_ / "lock");
  store_.reset();
  ASSERT_TRUE(other->check()) << other->check().error().text();
  ASSERT_TRUE(other->edit(answeredChange(2)));
  other.reset();
  expectKept(2);
  store_.reset();
  fs::remove_all(state_);
  fs::rename(away_, state_);
  expectKept(1);
}

TEST_F(Moved, NoCheckpointIsWrittenToAnothersFolder) {
  fs::rename(state_, away_);
  fs::create_directory(state_);
  CheckpointWriter writer(state_ / "checkpoint", [&] { return store_->check(); });
  writer.write(Bytes(1000, 1));
  ASSERT_TRUE(writer.flush(std::chrono::seconds(60)));
  EXPECT_EQ(writer.counters().failed, 1U);
  EXPECT_FALSE(fs::exists(state_ / "checkpoint"));
}

TEST_F(Moved, ALinkThatLeadsElsewhereNowIsNoticed) {
  const fs::path link = folder_.file("link"), other = folder_.file("other");
  store_.reset();
  fs::create_directory(other);
  fs::create_directory_symlink(state_, link);
  auto linked = Store::open(link);
  ASSERT_TRUE(linked) << linked.error().text();
  fs::remove(link);
  fs::create_directory_symlink(other, link);
  EXPECT_FALSE((*linked)->check());
}

TEST(PathClaim, TellsTheSecondOneWhoWasFirst) {
  const TemporaryFolder folder;
  {
    const auto first = PathClaim::take(folder.file("state"));
    EXPECT_FALSE(first.other());
    const auto second = PathClaim::take(folder.file("state/../state"));
    ASSERT_TRUE(second.other());
    EXPECT_EQ(*second.other(), getpid());
    EXPECT_FALSE(PathClaim::take(folder.file("elsewhere")).other());
  }
  EXPECT_FALSE(PathClaim::take(folder.file("state")).other());
}

}  // namespace
}  // namespace radiosity::state
