// The folder of what outlives the server: what comes back, and what happens to a bad disk.
#include "server/state/store.h"

#include <gtest/gtest.h>
#include <fstream>
#include <iterator>
#include <thread>

#include "common/sha256.h"
#include "server/state/checkpoint.h"
#include "tests/unit/client/temporary_folder.h"
#include "tests/unit/state/bytes_of.h"
#include "tests/unit/state/file_limit.h"

namespace radiosity::state {
namespace {

using test::bytesOf;

Revision loadEntry(std::uint64_t revision) { return {revision, 0, "", "room.glb", 12.5, 0, "", {}}; }
Document room(const std::string& gltf = R"({"a":1})") {
  return {"room.glb", gltf, {bytesOf("vertices")}, {bytesOf("picture")}};
}

/// An edit that leads from one revision to the next.
Store::Change editOf(std::uint64_t revision, const std::string& patch = "[]") {
  Store::Change made{{revision, 1, "ann", "replace /a", 13.25, 0, patch, {1, 1, {}, {}}}, {}, {}, 0, {}, {}};
  made.edit = Edit{revision, patch, "[1]", {1, 1, {}, {}}};
  made.edits_done = 1;
  return made;
}

class StoreTest : public testing::Test {
 protected:
  std::unique_ptr<Store> open() {
    auto store = Store::open(folder_.file("state"));
    EXPECT_TRUE(store) << store.error().text();
    return store ? std::move(*store) : nullptr;
  }
  Error openError() {
    auto store = Store::open(folder_.file("state"));
    EXPECT_FALSE(store);
    return store ? Error{} : store.error();
  }
  /// Revision 1 loaded, `last` - 1 edits after it.
  void fill(std::uint64_t last) {
    auto store = open();
    ASSERT_TRUE(store->load(loadEntry(1), room(), "digest"));
    for (std::uint64_t r = 2; r <= last; ++r) ASSERT_TRUE(store->edit(editOf(r)));
  }
  void flip(const std::string& name, std::size_t place) {
    auto text = folder_.read(name);
    ASSERT_LT(place, text.size());
    text[place] = static_cast<char>(text[place] ^ 0x10);
    folder_.write(name, text);
  }

  TemporaryFolder folder_;
};

TEST_F(StoreTest, AFolderHasAnEpochThatStaysOnceThereIsASceneAndCountsItsRuns) {
  std::string empty, epoch;
  {
    const auto store = open();
    empty = store->epoch();
    EXPECT_EQ(store->runs(), 1U);
    EXPECT_FALSE(store->takeKept().document);
  }
  {
    const auto store = open();
    epoch = store->epoch();
    EXPECT_NE(epoch, empty);  // revisions start again, and some may have been told of
    ASSERT_TRUE(store->load(loadEntry(1), room(), "digest"));
  }
  const auto store = open();
  EXPECT_EQ(store->epoch(), epoch);
  EXPECT_EQ(store->runs(), 3U);
  EXPECT_EQ(epoch.size(), 16U);
}

TEST_F(StoreTest, EverythingComesBack) {
  {
    auto store = open();
    ASSERT_TRUE(store->load(loadEntry(7), room(), "digest"));
    auto edit = editOf(8, R"([{"op":"replace","path":"/a","value":2}])");
    edit.revision.appended = edit.edit->appended = {1, 1, {bytesOf("more")}, {}};
    edit.answer = Answer{"id-1", ~std::uint64_t{0}, 8, 3, 4, 0};
    ASSERT_TRUE(store->edit(edit));
    ASSERT_TRUE(store->setSettings({{"seed", "5"}, {"sky", ""}}));
    ASSERT_TRUE(store->keepUpload({sha256Hex(std::string_view("up")), "up.glb"}, bytesOf("up"), {}));
  }
  auto store = open();
  const auto kept = store->takeKept();
  ASSERT_TRUE(kept.document);
  EXPECT_EQ(kept.document->name, "room.glb");
  EXPECT_EQ(kept.document->gltf, R"({"a":1})");
  EXPECT_EQ(*kept.document->buffers.at(0), *bytesOf("vertices"));
  EXPECT_EQ(*kept.document->images.at(0), *bytesOf("picture"));
  EXPECT_EQ(kept.document_revision, 7U);
  EXPECT_EQ(kept.loaded_digest, "digest");
  ASSERT_EQ(kept.revisions.size(), 2U);
  EXPECT_EQ(kept.revisions[0].revision, 7U);
  EXPECT_EQ(kept.revisions[1].by, "ann");
  EXPECT_EQ(kept.revisions[1].time_s, 13.25);
  EXPECT_EQ(*kept.revisions[1].appended.buffers.at(0), *bytesOf("more"));
  ASSERT_EQ(kept.edits.size(), 1U);
  EXPECT_EQ(kept.edits[0].back, "[1]");
  EXPECT_EQ(kept.edits_done, 1U);
  ASSERT_EQ(kept.answers.size(), 1U);
  EXPECT_EQ(kept.answers[0].request_id, "id-1");
  EXPECT_EQ(kept.answers[0].fingerprint, ~std::uint64_t{0});
  EXPECT_EQ(kept.answers[0].shots, 4U);
  EXPECT_EQ(kept.settings, (std::map<std::string, std::string>{{"seed", "5"}, {"sky", ""}}));
  ASSERT_EQ(store->uploads().size(), 1U);
  EXPECT_EQ(*store->readUpload(store->uploads()[0].id).value(), *bytesOf("up"));
}

TEST_F(StoreTest, ForgottenEditsAndDroppedUploadsAreGoneAndSoAreTheirBytes) {
  {
    auto store = open();
    ASSERT_TRUE(store->load(loadEntry(1), room(), "digest"));
    auto edit = editOf(2);
    edit.revision.appended = edit.edit->appended = {1, 1, {bytesOf("more")}, {}};
    ASSERT_TRUE(store->edit(edit));
    auto next = editOf(3);
    next.forgotten = {2};
    ASSERT_TRUE(store->edit(next));
    const Upload first{sha256Hex(std::string_view("one")), "one"}, second{sha256Hex(std::string_view("two")), "two"};
    ASSERT_TRUE(store->keepUpload(first, bytesOf("one"), {}));
    ASSERT_TRUE(store->keepUpload(second, bytesOf("two"), {first.id}));
    EXPECT_FALSE(std::filesystem::exists(folder_.file("state/blobs/" + first.id)));
    ASSERT_TRUE(store->load(loadEntry(4), room("{}"), "other"));
  }
  auto store = open();
  const auto kept = store->takeKept();
  EXPECT_TRUE(kept.edits.empty());
  EXPECT_EQ(kept.revisions.size(), 1U);
  EXPECT_EQ(store->uploads().size(), 1U);
  std::size_t blobs = 0;
  for ([[maybe_unused]] const auto& entry : std::filesystem::directory_iterator(folder_.file("state/blobs"))) ++blobs;
  EXPECT_EQ(blobs, 3U);  // vertices, picture, the second upload
}

TEST_F(StoreTest, WhatIsWrittenAheadStaysUntilItsLoadNamesIt) {
  const auto store = open();
  const Document next{"next.glb", "{}", {bytesOf("next vertices")}, {bytesOf("next picture"), bytesOf("another")}};
  const auto lies = [&](std::string_view what) {
    return std::filesystem::exists(folder_.file("state/blobs/" + sha256Hex(what)));
  };
  auto ahead = store->writeAhead(next);
  ASSERT_TRUE(ahead);
  for (const auto* what : {"next vertices", "next picture", "another"}) EXPECT_TRUE(lies(what)) << what;
  ASSERT_TRUE(store->load(loadEntry(1), room(), "digest"));  // it sweeps what nothing names
  EXPECT_TRUE(lies("next picture"));
  ASSERT_TRUE(store->load(loadEntry(2), next, store->digestOf(next)));
  ahead.reset();
  EXPECT_TRUE(lies("next picture"));
  ASSERT_TRUE(store->load(loadEntry(3), room(), "digest"));
  EXPECT_FALSE(lies("next picture")) << "it is named no more";
}

TEST_F(StoreTest, NothingIsWrittenAheadWhereTheFolderIsGone) {
  const auto store = open();
  std::filesystem::rename(folder_.file("state"), folder_.file("elsewhere"));
  EXPECT_FALSE(store->writeAhead(room()));
  EXPECT_FALSE(std::filesystem::exists(folder_.file("state")));
}

TEST_F(StoreTest, WhatForgottenEditsHadAppendedDoesNotAddUp) {
  constexpr std::uint64_t kEdits = 1000;
  auto store = open();
  ASSERT_TRUE(store->load(loadEntry(1), room(), "digest"));
  for (std::uint64_t r = 2; r <= kEdits; ++r) {
    auto edit = editOf(r);
    edit.revision.appended = edit.edit->appended = {1, 1, {bytesOf("appended by " + std::to_string(r))}, {}};
    edit.forgotten = {r - 1};
    if (store->wantsDocument()) edit.document = room();
    ASSERT_TRUE(store->edit(edit));
  }
  const std::filesystem::directory_iterator blobs(folder_.file("state/blobs"));
  // Those of the revisions that are kept: 256, and as many until the document is written whole.
  EXPECT_LT(std::distance(begin(blobs), end(blobs)), 600);
}

TEST_F(StoreTest, LongHistoriesAreBoundedOnceTheDocumentIsWrittenWhole) {
  {
    auto store = open();
    ASSERT_TRUE(store->load(loadEntry(1), room(), "digest"));
    for (std::uint64_t r = 2; r <= 1400; ++r) {
      auto edit = editOf(r);
      edit.forgotten = {r - 1};
      edit.answer = Answer{"id-" + std::to_string(r), r, r, 0, 0, 0};
      if (store->wantsDocument()) edit.document = room("{\"r\":" + std::to_string(r) + "}");
      ASSERT_TRUE(store->edit(edit));
    }
  }
  auto store = open();
  const auto kept = store->takeKept();
  EXPECT_GT(kept.document_revision, 1100U);
  EXPECT_EQ(kept.revisions.back().revision, 1400U);
  EXPECT_GE(kept.revisions.size(), 256U);
  EXPECT_LE(kept.revisions.size(), 520U);
  EXPECT_EQ(kept.edits.size(), 1U);
  EXPECT_EQ(kept.answers.size(), 1024U);
  EXPECT_EQ(kept.answers.back().request_id, "id-1400");
}

TEST_F(StoreTest, AFolderBelongsToOneServer) {
  const auto store = open();
  const auto error = openError();
  EXPECT_EQ(error.code, ErrorCode::kUnavailable);
  EXPECT_EQ(error.where, folder_.file("state/lock"));
  EXPECT_NE(error.message.find("another radiosityd"), std::string::npos) << error.message;
}

TEST_F(StoreTest, AFileInTheWayIsNamed) {
  folder_.write("state", "a file");
  EXPECT_EQ(openError().where, folder_.file("state"));
}

TEST_F(StoreTest, ADatabaseOfAnotherFormatIsRefused) {
  fill(2);
  {
    auto database = Database::open(folder_.file("state/state.sqlite"));
    ASSERT_TRUE(database);
    ASSERT_TRUE(database->run("PRAGMA user_version=99"));
  }
  EXPECT_EQ(openError().code, ErrorCode::kUnsupported);
}

TEST_F(StoreTest, WhatIsNoDatabaseIsRefusedByName) {
  std::filesystem::create_directories(folder_.file("state"));
  folder_.write("state/state.sqlite", std::string(8192, 'x'));
  const auto error = openError();
  EXPECT_EQ(error.code, ErrorCode::kBadInput);
  EXPECT_EQ(error.where, folder_.file("state/state.sqlite"));
}

/// Wherever a byte of the database is wrong: it is noticed and named, or the byte does not matter.
TEST_F(StoreTest, AFlippedByteIsNoticedOrWithoutConsequence) {
  fill(6);
  const auto sound = folder_.read("state/state.sqlite");
  ASSERT_FALSE(std::filesystem::exists(folder_.file("state/state.sqlite-wal")));  // all is in the file
  int noticed = 0;
  for (std::size_t place = 0; place < sound.size(); place += 97) {
    folder_.write("state/state.sqlite", sound);
    flip("state/state.sqlite", place);
    auto store = Store::open(folder_.file("state"));
    if (!store) {
      EXPECT_NE(store.error().where.find("state"), std::string::npos) << store.error().text();
      ++noticed;
      continue;
    }
    const auto kept = (*store)->takeKept();
    ASSERT_TRUE(kept.document) << place;
    EXPECT_EQ(kept.document->gltf, R"({"a":1})") << place;
    EXPECT_EQ(kept.revisions.size(), 6U) << place;
    EXPECT_EQ(kept.edits.size(), 5U) << place;
  }
  EXPECT_GT(noticed, 20);
}

TEST_F(StoreTest, ACutDatabaseIsNoticed) {
  fill(6);
  const auto sound = folder_.read("state/state.sqlite");
  for (const auto part : {std::size_t{1}, sound.size() / 2, sound.size() - 4096}) {
    folder_.write("state/state.sqlite", sound.substr(0, part));
    std::filesystem::remove(folder_.file("state/state.sqlite-wal"));
    EXPECT_EQ(openError().code, ErrorCode::kBadInput) << part;
  }
  folder_.write("state/state.sqlite", "");  // SQLite itself takes this for a new one
  const auto error = openError();
  EXPECT_EQ(error.code, ErrorCode::kBadInput);
  EXPECT_NE(error.message.find("revision 6 was acknowledged"), std::string::npos) << error.message;
}

TEST_F(StoreTest, ACutOrFlippedLogIsNoticed) {
  const TemporaryFolder copy;
  {
    auto store = open();
    ASSERT_TRUE(store->load(loadEntry(1), room(), "digest"));
    for (std::uint64_t r = 2; r <= 9; ++r) ASSERT_TRUE(store->edit(editOf(r)));
    // As a killed server would leave it: the log is not in the file yet.
    std::filesystem::copy(folder_.file("state"), copy.file("state"), std::filesystem::copy_options::recursive);
  }
  const auto log = copy.read("state/state.sqlite-wal");
  ASSERT_GT(log.size(), 20000U);
  const auto reopened = [&](const std::string& bytes) {
    copy.write("state/state.sqlite-wal", bytes);
    return Store::open(copy.file("state"));
  };
  auto flipped = log;
  flipped[log.size() - 5000] = static_cast<char>(flipped[log.size() - 5000] ^ 1);
  for (const auto& bytes : {log.substr(0, log.size() - 6000), flipped, std::string()}) {
    const TemporaryFolder saved;
    std::filesystem::copy(copy.file("state"), saved.file("state"), std::filesystem::copy_options::recursive);
    const auto store = reopened(bytes);
    ASSERT_FALSE(store);
    EXPECT_EQ(store.error().code, ErrorCode::kBadInput);
    std::filesystem::remove_all(copy.file("state"));
    std::filesystem::copy(saved.file("state"), copy.file("state"), std::filesystem::copy_options::recursive);
  }
  const auto store = reopened(log);
  ASSERT_TRUE(store) << store.error().text();
  EXPECT_EQ((*store)->takeKept().revisions.size(), 9U);
}

TEST_F(StoreTest, ADamagedOrMissingBlobIsNamed) {
  fill(2);
  const auto name = "state/blobs/" + sha256Hex(std::string_view("vertices"));
  flip(name, 3);
  auto error = openError();
  EXPECT_EQ(error.code, ErrorCode::kBadInput);
  EXPECT_EQ(error.where, folder_.file(name));
  std::filesystem::remove(folder_.file(name));
  error = openError();
  EXPECT_EQ(error.where, folder_.file(name));
}

TEST_F(StoreTest, WhatTheDiskHasDamagedIsMendedByWhoBringsItAgain) {
  const auto id = sha256Hex(std::string_view("upload"));
  ASSERT_TRUE(open()->keepUpload({id, "u"}, bytesOf("upload"), {}));
  flip("state/blobs/" + id, 3);
  auto store = open();
  ASSERT_FALSE(store->readUpload(id));
  ASSERT_TRUE(store->keepUpload({id, "u"}, bytesOf("upload"), {}));
  store.reset();
  const auto upload = open()->readUpload(id);
  ASSERT_TRUE(upload) << upload.error().text();
  EXPECT_EQ(**upload, *bytesOf("upload"));
}

TEST_F(StoreTest, TheSameBytesMayComeAsUploadAndSceneAtATime) {
  auto store = open();
  for (std::uint64_t round = 1; round <= 20; ++round) {
    const std::string text(4000000, static_cast<char>('a' + round));
    const auto id = sha256Hex(text);
    auto document = room("{}");
    document.buffers = {bytesOf(text)};
    Result<void> kept;
    std::thread uploading([&] { kept = store->keepUpload({id, "u"}, bytesOf(text), {}); });
    const auto loaded = store->load(loadEntry(round), document, "digest");
    uploading.join();
    ASSERT_TRUE(kept) << kept.error().text();
    ASSERT_TRUE(loaded) << loaded.error().text();
    ASSERT_EQ(sha256Hex(folder_.read("state/blobs/" + id)), id);
  }
}

TEST_F(StoreTest, WhatDoesNotFitOnTheDiskIsRefusedAndTheRestStays) {
  {
    auto store = open();
    ASSERT_TRUE(store->load(loadEntry(1), room(), "digest"));
    {
      const test::FileLimit full(std::filesystem::file_size(folder_.file("state/state.sqlite-wal")));
      const auto refused = store->edit(editOf(2, std::string(100000, ' ')));
      ASSERT_FALSE(refused);
      EXPECT_EQ(refused.error().code, ErrorCode::kUnavailable);
      EXPECT_EQ(refused.error().where, folder_.file("state/state.sqlite"));
      EXPECT_NE(refused.error().message.find("File too large"), std::string::npos) << refused.error().message;
    }
    ASSERT_TRUE(store->edit(editOf(2, "[3]")));  // there is room again
    {
      const test::FileLimit full(1000);
      const std::string big(100000, 'b');
      const auto upload = store->keepUpload({sha256Hex(big), "big"}, bytesOf(big), {});
      ASSERT_FALSE(upload);
      EXPECT_NE(upload.error().where.find("blobs"), std::string::npos);
      EXPECT_FALSE(writeCheckpoint(folder_.file("state/checkpoint"), Bytes(5000)));
    }
    EXPECT_FALSE(std::filesystem::exists(folder_.file("state/checkpoint")));
  }
  auto store = open();
  const auto kept = store->takeKept();
  ASSERT_EQ(kept.revisions.size(), 2U);
  EXPECT_EQ(kept.revisions[1].patch, "[3]");
}

// ---- checkpoints ----

TEST_F(StoreTest, ACheckpointComesBackOrIsRefusedForAReason) {
  const std::filesystem::path file = folder_.file("checkpoint");
  EXPECT_FALSE(readCheckpoint(file).value());
  Bytes body(100000);
  for (std::size_t i = 0; i < body.size(); ++i) body[i] = static_cast<std::uint8_t>(i * 7);
  ASSERT_TRUE(writeCheckpoint(file, body));
  EXPECT_EQ(**readCheckpoint(file), body);
  const auto sound = folder_.read("checkpoint");
  for (const std::size_t place : {0UL, 30UL, 100UL, 5000UL, sound.size() - 1}) {
    folder_.write("checkpoint", sound);
    flip("checkpoint", place);
    EXPECT_EQ(readCheckpoint(file).error().code, place == 30 ? ErrorCode::kUnsupported : ErrorCode::kBadInput) << place;
  }
  for (const std::size_t part : {0UL, 10UL, 152UL, 153UL, sound.size() - 1}) {
    folder_.write("checkpoint", sound.substr(0, part));
    EXPECT_EQ(readCheckpoint(file).error().code, ErrorCode::kBadInput) << part;
  }
}

TEST_F(StoreTest, TheWriterWritesTheNewest) {
  const std::filesystem::path file = folder_.file("checkpoint");
  CheckpointWriter writer(file);
  for (std::uint8_t i = 0; i < 50; ++i) writer.write(Bytes(1000, i));
  ASSERT_TRUE(writer.flush(std::chrono::seconds(60)));
  EXPECT_FALSE(writer.isBusy());
  EXPECT_EQ(**readCheckpoint(file), Bytes(1000, 49));
  EXPECT_GE(writer.counters().written, 1U);
  EXPECT_EQ(writer.counters().bytes, 1000U);
}

}  // namespace
}  // namespace radiosity::state
