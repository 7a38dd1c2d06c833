// Store: what is read, and checked, when the folder is opened.
#include <fmt/format.h>

#include <charconv>
#include <utility>

#include "server/state/store.h"
#include "server/state/store_rows.h"

namespace radiosity::state {
namespace {

std::uint64_t numberIn(const std::map<std::string, std::string>& values, const std::string& key) {
  const auto found = values.find(key);
  std::uint64_t value = 0;
  if (found != values.end())
    (void)std::from_chars(found->second.data(), found->second.data() + found->second.size(), value);
  return value;
}

}  // namespace

Result<std::map<std::string, std::string>> Store::meta() {
  const auto rows = checkedRows(database_, "meta", "");
  if (!rows) return tl::unexpected(rows.error());
  std::map<std::string, std::string> values;
  for (const auto& row : *rows) values[text(row, 0)] = text(row, 1);
  return values;
}

Result<void> Store::readAll() {
  const auto values = meta();
  if (!values) return tl::unexpected(values.error());
  if (const auto epoch = values->find("epoch"); epoch != values->end()) epoch_ = epoch->second;
  runs_ = numberIn(*values, "runs");
  kept_.edits_done = numberIn(*values, "done");
  for (const auto& [key, value] : *values) {
    if (key.starts_with(kSettingPrefix)) kept_.settings[key.substr(kSettingPrefix.size())] = value;
  }
  for (const auto part : {&Store::readScene, &Store::readRevisions, &Store::readEdits, &Store::readAnswers}) {
    if (auto read = (this->*part)(); !read) return read;
  }
  return checkNewest();
}

Result<std::vector<SharedBytes>> Store::getBlobs(const std::string& ids) {
  std::vector<SharedBytes> blobs;
  for (const auto& id : splitIds(ids)) {
    auto bytes = blobs_.get(id);
    if (!bytes) return tl::unexpected(bytes.error());
    blobs.push_back(std::move(*bytes));
  }
  return blobs;
}

Result<void> Store::readScene() {
  const auto rows = checkedRows(database_, "scene", "");
  if (!rows) return tl::unexpected(rows.error());
  if (rows->empty()) return {};
  const auto& row = rows->front();
  auto buffers = getBlobs(text(row, 4)), images = getBlobs(text(row, 5));
  if (!buffers || !images) return tl::unexpected(buffers ? images.error() : buffers.error());
  kept_.document_revision = document_revision_ = number(row, 1);
  kept_.document = Document{text(row, 2), text(row, 3), std::move(*buffers), std::move(*images)};
  kept_.loaded_digest = digest_ = text(row, 6);
  return {};
}

Result<void> Store::readRevisions() {
  const auto rows = checkedRows(database_, "revisions", "ORDER BY revision");
  if (!rows) return tl::unexpected(rows.error());
  for (const auto& row : *rows) {
    auto buffers = getBlobs(text(row, 9)), images = getBlobs(text(row, 10));
    if (!buffers || !images) return tl::unexpected(buffers ? images.error() : buffers.error());
    Revision revision{number(row, 0), integer(row, 1), text(row, 2), text(row, 3),
                      real(row, 4),   number(row, 5),  text(row, 6), {}};
    revision.appended = {number(row, 7), number(row, 8), std::move(*buffers), std::move(*images)};
    if (revision.revision > document_revision_) {
      ++since_document_;
      patch_bytes_ += revision.patch.size();
    }
    kept_.revisions.push_back(std::move(revision));
  }
  return {};
}

Result<void> Store::readEdits() {
  const auto rows = checkedRows(database_, "edits", "ORDER BY revision");
  if (!rows) return tl::unexpected(rows.error());
  for (const auto& row : *rows) {
    auto buffers = getBlobs(text(row, 5)), images = getBlobs(text(row, 6));
    if (!buffers || !images) return tl::unexpected(buffers ? images.error() : buffers.error());
    Edit edit{number(row, 0), text(row, 1), text(row, 2), {}};
    edit.appended = {number(row, 3), number(row, 4), std::move(*buffers), std::move(*images)};
    kept_.edits.push_back(std::move(edit));
  }
  return {};
}

Result<void> Store::readAnswers() {
  const auto rows = checkedRows(database_, "answers", "ORDER BY revision");
  if (!rows) return tl::unexpected(rows.error());
  for (const auto& row : *rows)
    kept_.answers.push_back(
        {text(row, 0), number(row, 1), number(row, 2), number(row, 3), number(row, 4), number(row, 5)});
  const auto uploads = checkedRows(database_, "uploads", "ORDER BY place");
  if (!uploads) return tl::unexpected(uploads.error());
  for (const auto& row : *uploads) uploads_.push_back({text(row, 0), text(row, 1)});
  return {};
}

/// A log that was cut short gives an older state that is sound by itself: only the note beside it tells.
Result<void> Store::checkNewest() const {
  std::uint64_t newest = 0;
  std::string broken;
  for (const auto& revision : kept_.revisions) {
    if (newest > 0 && revision.revision != newest + 1) broken = fmt::format("revision {} is missing", newest + 1);
    newest = revision.revision;
  }
  if (kept_.document.has_value() != !kept_.revisions.empty() || newest < document_revision_ ||
      kept_.edits_done > kept_.edits.size())
    broken = "its tables do not go together";
  if (lock_.notedRevision() > newest)
    broken =
        fmt::format("revision {} was acknowledged, and {} is the last that is there", lock_.notedRevision(), newest);
  if (broken.empty()) return {};
  return fail(
      ErrorCode::kBadInput,
      "damaged: " + broken + "; put a backup of the whole folder in its place, or move the folder away to start anew",
      database_.file().string());
}

}  // namespace radiosity::state
