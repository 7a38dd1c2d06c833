// What outlives the server: the scene with its revisions, the edits that can be taken back, answers of edits that were
// acknowledged, settings, uploads. In a folder: state.sqlite (write-ahead log, synchronous FULL), blobs/ (buffers,
// images and uploads by SHA-256), checkpoint (checkpoint.h), lock. What a method has returned without an error is on
// the disk, in the folder that was opened: where that is no longer at its path, nothing is kept. The solve thread calls
// all but check() and the uploads' methods, which are thread-safe with everything.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "common/bytes.h"
#include "common/result.h"
#include "server/state/blobs.h"
#include "server/state/database.h"
#include "server/state/files.h"
#include "server/state/known_files.h"
#include "server/state/path_claim.h"

namespace radiosity::state {

/// A glTF document: its JSON as text, and the bytes that it refers to.
struct Document {
  std::string name, gltf;
  std::vector<SharedBytes> buffers, images;
};

/// Bytes that an edit keeps of those that were there, and those that it appends.
struct Appended {
  std::uint64_t buffers_before = 0, images_before = 0;
  std::vector<SharedBytes> buffers, images;
};

/// How a revision came about, and the patch (plain RFC 6902, JSON text) that made it of the one before; a load has
/// none.
struct Revision {
  std::uint64_t revision = 0;
  std::int64_t kind = 0;  ///< the engine's number
  std::string by, summary;
  double time_s = 0.0;        ///< since 1970-01-01 UTC
  std::uint64_t stepped = 0;  ///< of undo and redo
  std::string patch;
  Appended appended;
};

/// An edit that can be taken back, or made again.
struct Edit {
  std::uint64_t revision = 0;
  std::string forth, back;
  Appended appended;
};

/// The answer of an edit that came with a requestId.
struct Answer {
  std::string request_id;
  std::uint64_t fingerprint = 0;  ///< of the request
  std::uint64_t revision = 0, surfaces = 0, shots = 0, stepped = 0;
};

struct Upload {
  std::string id, name;
};

/// What was there when the folder was opened.
struct Kept {
  std::optional<Document> document;  ///< as of `document_revision`; the revisions after it lead to the newest
  std::uint64_t document_revision = 0;
  std::string loaded_digest;        ///< of the document when it was loaded
  std::vector<Revision> revisions;  ///< oldest first, without gaps
  std::vector<Edit> edits;          ///< oldest first
  std::uint64_t edits_done = 0;     ///< of these; those behind are taken back
  std::vector<Answer> answers;      ///< oldest first
  std::map<std::string, std::string> settings;
};

class Store {
 public:
  /// Opens the folder, or makes it. Reads and checks everything: kBadInput names the file that is damaged;
  /// kUnavailable: in use, or cannot be written.
  [[nodiscard]] static Result<std::unique_ptr<Store>> open(const std::filesystem::path& folder);
  ~Store();
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  /// Whether what is written now will be found at the path at the next start: kUnavailable names the database, its log,
  /// the lock or the blobs' folder where it was removed, moved or replaced. Every method that keeps something asks this
  /// first and again before it commits. Any thread. Cost: four times stat().
  [[nodiscard]] Result<void> check() const { return known_.check(); }
  [[nodiscard]] const std::filesystem::path& folder() const { return folder_; }
  /// Random text, the same as long as the folder lives.
  [[nodiscard]] const std::string& epoch() const { return epoch_; }
  /// How often the folder was opened, this time included.
  [[nodiscard]] std::uint64_t runs() const { return runs_; }
  [[nodiscard]] Kept takeKept() { return std::move(kept_); }

  /// Of JSON and bytes; whoever loads the same file has the same.
  [[nodiscard]] std::string digestOf(const Document& document);

  /// Buffers and images of a scene that load() is to name, on the disk already: load() does not wait for the disk,
  /// which takes a millisecond for each of them. They stay until this goes; null: none are. What cannot be written is
  /// left to load(), which says why. Any thread; the store must be there as long. Interruption points between two of
  /// them.
  [[nodiscard]] std::shared_ptr<void> writeAhead(const Document& document);

  /// A scene was loaded: replaces document, revisions and edits.
  [[nodiscard]] Result<void> load(const Revision& revision, const Document& document, const std::string& digest);

  struct Change {
    Revision revision;
    std::optional<Edit> edit;              ///< a new one
    std::vector<std::uint64_t> forgotten;  ///< edits that can no longer be taken back or made again
    std::uint64_t edits_done = 0;
    std::optional<Answer> answer;
    std::optional<Document> document;  ///< the whole; needed where wantsDocument()
  };
  /// One edit, undo or redo.
  [[nodiscard]] Result<void> edit(const Change& change);
  /// What is said of the last edit, known better once it was made.
  [[nodiscard]] Result<void> correct(const Answer& answer);
  /// Enough revisions have come since the document was last written whole.
  [[nodiscard]] bool wantsDocument() const { return since_document_ >= kRevisionsKept || patch_bytes_ >= kPatchBytes; }

  [[nodiscard]] Result<void> setSettings(const std::map<std::string, std::string>& settings);

  /// The end: all is in the database itself, nothing in its log. Any thread; best effort.
  void foldLog();

  /// An upload is on the disk; those named in `dropped` are forgotten. Any thread; writes for as long as it takes.
  [[nodiscard]] Result<void> keepUpload(const Upload& upload, const SharedBytes& bytes,
                                        const std::vector<std::string>& dropped);
  [[nodiscard]] Result<SharedBytes> readUpload(const std::string& id) { return blobs_.get(id); }
  /// Those there were when the folder was opened, oldest first.
  [[nodiscard]] const std::vector<Upload>& uploads() const { return uploads_; }

 private:
  static constexpr std::uint64_t kRevisionsKept = 256, kPatchBytes = std::uint64_t{4} << 20;

  Store(std::filesystem::path folder, FolderLock lock, Database database)
      : folder_(std::move(folder)),
        lock_(std::move(lock)),
        claim_(PathClaim::take(folder_)),
        database_(std::move(database)),
        blobs_(folder_ / "blobs") {}
  [[nodiscard]] Result<void> knowFiles();
  /// All of `work` or nothing, in the files that lie at their paths.
  [[nodiscard]] Result<void> keep(const std::function<Result<void>()>& work);
  [[nodiscard]] Result<void> prepareTables();
  [[nodiscard]] Result<void> beginRun();
  [[nodiscard]] Result<void> readAll();
  [[nodiscard]] Result<void> readScene();
  [[nodiscard]] Result<void> readRevisions();
  [[nodiscard]] Result<void> readEdits();
  [[nodiscard]] Result<void> readAnswers();
  [[nodiscard]] Result<void> checkNewest() const;
  [[nodiscard]] Result<std::map<std::string, std::string>> meta();
  [[nodiscard]] Result<void> putMeta(const std::string& key, const std::string& value);
  [[nodiscard]] Result<void> putDocument(std::uint64_t revision, const Document& document, const std::string& digest);
  [[nodiscard]] Result<void> putRevision(const Revision& revision);
  [[nodiscard]] Result<void> putEdit(const Edit& edit);
  [[nodiscard]] Result<void> putAnswer(const Answer& answer);
  [[nodiscard]] Result<void> forgetOld(std::uint64_t newest);
  [[nodiscard]] Result<std::string> putBlobs(const std::vector<SharedBytes>& blobs);
  [[nodiscard]] Result<std::vector<SharedBytes>> getBlobs(const std::string& ids);
  void sweepBlobs();
  void sweepUnwanted();

  std::filesystem::path folder_;
  FolderLock lock_;
  PathClaim claim_;
  KnownFiles known_;  ///< constant once open() has returned
  std::mutex mutex_;  ///< of database_: uploads come from another thread
  Database database_;
  Blobs blobs_;
  std::string epoch_;
  std::uint64_t runs_ = 0;
  Kept kept_;
  std::vector<Upload> uploads_;
  std::string digest_;  ///< of the document when it was loaded
  std::uint64_t document_revision_ = 0, since_document_ = 0, patch_bytes_ = 0;
};

}  // namespace radiosity::state
