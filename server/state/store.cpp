#include "server/state/store.h"

#include <fmt/format.h>

#include <array>
#include <new>
#include <set>
#include <string_view>
#include <utility>

#include "common/log.h"
#include "common/sha256.h"
#include "common/task.h"
#include "server/state/store_rows.h"

namespace radiosity::state {
namespace {

/// Raised when tables change their meaning; an older program refuses a newer folder and the other way round.
constexpr std::int64_t kFormat = 1;
constexpr std::size_t kAnswersKept = 1024;

constexpr std::array kTables = {
    "CREATE TABLE IF NOT EXISTS meta(key TEXT PRIMARY KEY, value TEXT, digest TEXT)",
    "CREATE TABLE IF NOT EXISTS scene(id INTEGER PRIMARY KEY, revision INTEGER, name TEXT, gltf TEXT, buffers TEXT, "
    "images TEXT, loaded TEXT, digest TEXT)",
    "CREATE TABLE IF NOT EXISTS revisions(revision INTEGER PRIMARY KEY, kind INTEGER, by TEXT, summary TEXT, time "
    "REAL, "
    "stepped INTEGER, patch TEXT, buffers_before INTEGER, images_before INTEGER, buffers TEXT, images TEXT, digest "
    "TEXT)",
    "CREATE TABLE IF NOT EXISTS edits(revision INTEGER PRIMARY KEY, forth TEXT, back TEXT, buffers_before INTEGER, "
    "images_before INTEGER, buffers TEXT, images TEXT, digest TEXT)",
    "CREATE TABLE IF NOT EXISTS answers(request TEXT PRIMARY KEY, fingerprint INTEGER, revision INTEGER, surfaces "
    "INTEGER, shots INTEGER, stepped INTEGER, digest TEXT)",
    "CREATE TABLE IF NOT EXISTS uploads(id TEXT PRIMARY KEY, name TEXT, place INTEGER, digest TEXT)"};

}  // namespace

Result<std::unique_ptr<Store>> Store::open(const std::filesystem::path& folder) {
  auto lock = FolderLock::take(folder);
  if (!lock) return tl::unexpected(lock.error());
  auto database = Database::open(folder / "state.sqlite");
  if (!database) return tl::unexpected(database.error());
  std::unique_ptr<Store> store(new Store(folder, std::move(*lock), std::move(*database)));
  if (auto ready = store->blobs_.prepare(); !ready) return tl::unexpected(ready.error());
  if (auto ready = store->prepareTables(); !ready) return tl::unexpected(ready.error());
  if (auto read = store->readAll(); !read) return tl::unexpected(read.error());
  if (auto begun = store->beginRun(); !begun) return tl::unexpected(begun.error());
  if (auto known = store->knowFiles(); !known) return tl::unexpected(known.error());
  store->sweepBlobs();
  if (const auto& other = store->claim_.other())
    log::warn(
        "{}: another radiosityd (process {}) was started with this path and still runs; the folder that it opened was "
        "removed or moved away, and it refuses edits until that folder is back: end it, or give one of the two another "
        "--state",
        folder.string(), *other);
  return store;
}

Store::~Store() {
  if (!check()) database_.keepLog();
}

/// Called once the database was written, so that its log is there.
Result<void> Store::knowFiles() {
  const auto database = database_.identity();
  if (!database) return tl::unexpected(database.error());
  known_.add(folder_ / "lock", lock_.identity());
  known_.add(database_.file(), *database);
  if (auto known = known_.add(database_.file().string() + "-wal"); !known) return known;
  if (auto known = known_.add(folder_ / "blobs"); !known) return known;
  return check();
}

Result<void> Store::keep(const std::function<Result<void>()>& work) {
  if (auto here = check(); !here) return here;
  return database_.atomically([&]() -> Result<void> {
    if (auto done = work(); !done) return done;
    return check();
  });
}

Result<void> Store::prepareTables() {
  if (auto sound = database_.checkPages(); !sound) return sound;
  const auto version = database_.rows("PRAGMA user_version");
  if (!version) return tl::unexpected(version.error());
  const auto format = integer(version->front(), 0);
  if (format != 0 && format != kFormat)
    return fail(
        ErrorCode::kUnsupported,
        fmt::format("was written by another version of radiosityd (format {}, this one has {})", format, kFormat),
        database_.file().string());
  if (format == kFormat) return {};
  return database_.atomically([&]() -> Result<void> {
    for (const auto* table : kTables) {
      if (auto made = database_.run(table); !made) return made;
    }
    return database_.run(fmt::format("PRAGMA user_version={}", kFormat));
  });
}

/// Every opening has a number. Without a scene revisions start again, at those that were told of one whose first light
/// was being shown, and which was never kept: that is another epoch.
Result<void> Store::beginRun() {
  ++runs_;
  return database_.atomically([&]() -> Result<void> {
    if (epoch_.empty() || !kept_.document) {
      epoch_ = randomHex(8);
      if (auto put = putMeta("epoch", epoch_); !put) return put;
    }
    return putMeta("runs", std::to_string(runs_));
  });
}

Result<void> Store::putMeta(const std::string& key, const std::string& value) {
  return putRow(database_, "meta", {key, value});
}

std::string Store::digestOf(const Document& document) {
  std::string all = document.gltf;
  for (const auto* list : {&document.buffers, &document.images}) {
    all += '|';
    for (const auto& bytes : *list) all += blobs_.idOf(bytes);
  }
  return sha256Hex(std::string_view(all));
}

std::shared_ptr<void> Store::writeAhead(const Document& document) {
  if (!check()) return nullptr;
  struct Held {
    Blobs& blobs;
    std::vector<std::string> ids = {};
    explicit Held(Blobs& of) : blobs(of) {}
    Held(const Held&) = delete;
    Held& operator=(const Held&) = delete;
    ~Held() {
      for (const auto& id : ids) blobs.release(id);
    }
  };
  auto held = std::make_shared<Held>(blobs_);
  held->ids.reserve(document.buffers.size() + document.images.size());  // what is held is released
  for (const auto* list : {&document.buffers, &document.images}) {
    for (const auto& bytes : *list) {
      interruptionPoint();
      auto id = blobs_.idOf(bytes);
      if (!blobs_.putAs(id, bytes)) return held;
      held->ids.push_back(std::move(id));
    }
  }
  return held;
}

Result<std::string> Store::putBlobs(const std::vector<SharedBytes>& blobs) {
  std::string ids;
  for (const auto& bytes : blobs) {
    auto id = blobs_.put(bytes);
    if (!id) return id;
    ids += (ids.empty() ? "" : ",") + *id;
  }
  return ids;
}

Result<void> Store::putDocument(std::uint64_t revision, const Document& document, const std::string& digest) {
  const auto buffers = putBlobs(document.buffers), images = putBlobs(document.images);
  if (!buffers || !images) return tl::unexpected(buffers ? images.error() : buffers.error());
  return putRow(database_, "scene",
                {std::int64_t{0}, signedOf(revision), document.name, document.gltf, *buffers, *images, digest});
}

Result<void> Store::putRevision(const Revision& revision) {
  const auto buffers = putBlobs(revision.appended.buffers), images = putBlobs(revision.appended.images);
  if (!buffers || !images) return tl::unexpected(buffers ? images.error() : buffers.error());
  return putRow(database_, "revisions",
                {signedOf(revision.revision), revision.kind, revision.by, revision.summary, revision.time_s,
                 signedOf(revision.stepped), revision.patch, signedOf(revision.appended.buffers_before),
                 signedOf(revision.appended.images_before), *buffers, *images});
}

Result<void> Store::putEdit(const Edit& edit) {
  const auto buffers = putBlobs(edit.appended.buffers), images = putBlobs(edit.appended.images);
  if (!buffers || !images) return tl::unexpected(buffers ? images.error() : buffers.error());
  return putRow(database_, "edits",
                {signedOf(edit.revision), edit.forth, edit.back, signedOf(edit.appended.buffers_before),
                 signedOf(edit.appended.images_before), *buffers, *images});
}

Result<void> Store::putAnswer(const Answer& answer) {
  return putRow(database_, "answers",
                {answer.request_id, signedOf(answer.fingerprint), signedOf(answer.revision), signedOf(answer.surfaces),
                 signedOf(answer.shots), signedOf(answer.stepped)});
}

/// Revisions that nobody can resume from any more, once the document is newer, and answers beyond those promised.
Result<void> Store::forgetOld(std::uint64_t newest) {
  if (newest > kRevisionsKept) {
    const std::array<Value, 2> limits = {signedOf(newest - kRevisionsKept), signedOf(document_revision_)};
    if (auto gone = database_.run("DELETE FROM revisions WHERE revision <= ? AND revision <= ?", limits); !gone)
      return gone;
  }
  // Every revision has one answer at most, so that the newest are those of the highest revisions.
  return database_.run(
      fmt::format("DELETE FROM answers WHERE revision <= (SELECT revision FROM answers ORDER BY "
                  "revision DESC LIMIT 1 OFFSET {})",
                  kAnswersKept));
}

Result<void> Store::load(const Revision& revision, const Document& document, const std::string& digest) {
  const std::scoped_lock lock(mutex_);
  auto new_digest = digest;  // after it is kept nothing may fail
  auto kept = keep([&]() -> Result<void> {
    for (const auto* table : {"revisions", "edits"}) {
      if (auto gone = database_.run(fmt::format("DELETE FROM {}", table)); !gone) return gone;
    }
    if (auto put = putDocument(revision.revision, document, digest); !put) return put;
    if (auto put = putRevision(revision); !put) return put;
    return putMeta("done", "0");
  });
  if (!kept) return kept;
  lock_.noteRevision(revision.revision);
  digest_ = std::move(new_digest);
  document_revision_ = revision.revision;
  since_document_ = patch_bytes_ = 0;
  sweepBlobs();
  return {};
}

Result<void> Store::edit(const Change& change) {
  const std::scoped_lock lock(mutex_);
  const auto newest = change.revision.revision;
  auto kept = keep([&]() -> Result<void> {
    if (auto put = putRevision(change.revision); !put) return put;
    for (const auto revision : change.forgotten) {
      const std::array<Value, 1> which = {signedOf(revision)};
      if (auto gone = database_.run("DELETE FROM edits WHERE revision = ?", which); !gone) return gone;
    }
    if (change.edit) {
      if (auto put = putEdit(*change.edit); !put) return put;
    }
    if (change.answer) {
      if (auto put = putAnswer(*change.answer); !put) return put;
    }
    if (change.document) {
      if (auto put = putDocument(newest, *change.document, digest_); !put) return put;
    }
    if (auto gone = forgetOld(newest); !gone) return gone;
    return putMeta("done", std::to_string(change.edits_done));
  });
  if (!kept) return kept;
  lock_.noteRevision(newest);
  ++since_document_;
  patch_bytes_ += change.revision.patch.size();
  if (change.document) {
    document_revision_ = newest;
    since_document_ = patch_bytes_ = 0;
    sweepBlobs();  // now and then, so that what forgotten edits had appended does not add up until the next start
  }
  return {};
}

Result<void> Store::correct(const Answer& answer) {
  const std::scoped_lock lock(mutex_);
  return keep([&] { return putAnswer(answer); });
}

Result<void> Store::setSettings(const std::map<std::string, std::string>& settings) {
  const std::scoped_lock lock(mutex_);
  return keep([&]() -> Result<void> {
    for (const auto& [key, value] : settings) {
      if (auto put = putMeta(std::string(kSettingPrefix) + key, value); !put) return put;
    }
    return {};
  });
}

Result<void> Store::keepUpload(const Upload& upload, const SharedBytes& bytes,
                               const std::vector<std::string>& dropped) {
  if (auto here = check(); !here) return here;
  if (auto put = blobs_.putAs(upload.id, bytes); !put) return put;
  const std::scoped_lock lock(mutex_);
  auto kept = keep([&]() -> Result<void> {
    const auto last = database_.rows("SELECT COALESCE(MAX(place), 0) FROM uploads");
    if (!last) return tl::unexpected(last.error());
    for (const auto& id : dropped) {
      const std::array<Value, 1> which = {id};
      if (auto gone = database_.run("DELETE FROM uploads WHERE id = ?", which); !gone) return gone;
    }
    return putRow(database_, "uploads", {upload.id, upload.name, integer(last->front(), 0) + 1});
  });
  blobs_.release(upload.id);
  if (kept && !dropped.empty()) sweepBlobs();
  return kept;
}

void Store::foldLog() {
  const std::scoped_lock lock(mutex_);
  (void)database_.run("PRAGMA wal_checkpoint(TRUNCATE)");
}

/// Best effort: what is left over takes room and nothing else.
/// What memory does not suffice for is swept some other time.
void Store::sweepBlobs() {
  try {
    sweepUnwanted();
  } catch (const std::bad_alloc&) {
    return;
  }
}

void Store::sweepUnwanted() {
  if (!check()) return;  // the blobs there are another server's
  std::set<std::string> wanted;
  constexpr std::array kNames = {"SELECT buffers || ',' || images FROM scene",
                                 "SELECT buffers || ',' || images FROM revisions",
                                 "SELECT buffers || ',' || images FROM edits", "SELECT id FROM uploads"};
  for (const auto* query : kNames) {
    const auto rows = database_.rows(query);
    if (!rows) return;
    for (const auto& row : *rows) {
      for (const auto& id : splitIds(text(row, 0))) wanted.insert(id);
    }
  }
  blobs_.sweep(wanted);
}

}  // namespace radiosity::state
