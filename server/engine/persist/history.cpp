#include "server/engine/persist/history.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "common/check.h"
#include "server/scene/document/touched_parts.h"

namespace radiosity::engine {
namespace {

using nlohmann::json;

constexpr std::size_t kMaxSummaryBytes = 200;

double now() { return std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count(); }

/// At most kMaxSummaryBytes, cut between characters of UTF-8.
std::string shortened(std::string text) {
  if (text.size() <= kMaxSummaryBytes) return text;
  auto end = kMaxSummaryBytes - 3;
  while (end > 0 && (static_cast<unsigned char>(text[end]) & 0xC0U) == 0x80U) --end;
  return text.substr(0, end) + "...";
}

std::string summaryOf(const json& patch) {
  std::string text;
  std::size_t changes = 0;
  for (const auto& operation : patch) {
    const auto op = operation.value("op", std::string());
    if (op == "test") continue;
    if (++changes == 1) text = op + " " + operation.value("path", std::string());
  }
  if (changes > 1) text = shortened(text) + " and " + std::to_string(changes - 1) + " more";
  return changes == 0 ? "tests only" : shortened(text);
}

std::string patchText(const json& patch) { return patch.dump(-1, ' ', false, json::error_handler_t::replace); }

std::size_t bytesOf(const state::Edit& edit) { return edit.forth.size() + edit.back.size(); }

std::vector<SharedBytes> appended(const std::vector<SharedBytes>& before, const std::vector<SharedBytes>& after) {
  return {after.begin() + static_cast<std::ptrdiff_t>(std::min(before.size(), after.size())), after.end()};
}

}  // namespace

void History::log(PastRevision entry) {
  noteStep(entry);
  log_.push_back(std::move(entry));
  if (log_.size() > bounds_.revisions) log_.erase(log_.begin());
}

/// What an undo or a redo says of an earlier entry.
void History::noteStep(const PastRevision& entry) {
  if (entry.kind != PastRevision::Kind::kUndo && entry.kind != PastRevision::Kind::kRedo) return;
  for (auto& past : log_) {
    if (past.kind == PastRevision::Kind::kPatch && past.revision == entry.stepped)
      past.undone = entry.kind == PastRevision::Kind::kUndo;
  }
}

History::Next History::nextLoad(std::uint64_t revision, const std::string& by, const std::string& name) {
  Next next;
  next.entry = {revision, PastRevision::Kind::kLoad, by, shortened(name), now()};
  return next;
}

History::Next History::nextEdit(std::uint64_t revision, const std::string& by, const json& patch,
                                const scene::Document& before, const scene::Document& after,
                                const scene::TouchedParts& parts) const {
  Next next;
  next.entry = {revision, PastRevision::Kind::kPatch, by, summaryOf(patch), now()};
  next.patch = patchText(scene::diffDocuments(before.gltf, after.gltf, parts));
  next.appended = {before.buffers.size(), before.images.size(), appended(before.buffers, after.buffers),
                   appended(before.images, after.images)};
  next.edit =
      state::Edit{revision, next.patch, patchText(scene::diffDocuments(after.gltf, before.gltf, parts)), next.appended};
  for (auto n = done_; n < edits_.size(); ++n) next.forgotten.push_back(edits_[n].revision);
  std::size_t count = done_ + 1, bytes = bytesOf(*next.edit);
  for (std::size_t n = 0; n < done_; ++n) bytes += bytesOf(edits_[n]);
  for (std::size_t n = 0; n < done_ && (count > bounds_.edits || bytes > bounds_.patch_bytes); ++n, --count) {
    next.forgotten.push_back(edits_[n].revision);
    bytes -= bytesOf(edits_[n]);
  }
  if (count > bounds_.edits || bytes > bounds_.patch_bytes) {  // too large to be taken back
    next.edit.reset();
    --count;
  }
  next.done = count;
  return next;
}

Result<History::Step> History::step(bool redo, const scene::Document& now) const {
  if (redo ? done_ == edits_.size() : done_ == 0)
    return fail(ErrorCode::kNotFound, redo ? "there is no edit to make again" : "there is no edit to take back");
  const auto& edit = edits_[redo ? done_ : done_ - 1];
  Step step{now, redo ? edit.forth : edit.back, edit.revision};
  step.document.gltf.patch_inplace(json::parse(step.patch));  // our own, of just this document
  step.document.imported.reset();
  auto &buffers = step.document.buffers, &images = step.document.images;
  buffers.resize(edit.appended.buffers_before);
  images.resize(edit.appended.images_before);
  if (redo) {
    buffers.insert(buffers.end(), edit.appended.buffers.begin(), edit.appended.buffers.end());
    images.insert(images.end(), edit.appended.images.begin(), edit.appended.images.end());
  }
  return step;
}

History::Next History::nextStep(std::uint64_t revision, const std::string& by, bool redo) const {
  RAD_CHECK(redo ? done_ < edits_.size() : done_ > 0);
  const auto& edit = edits_[redo ? done_ : done_ - 1];
  Next next;
  next.entry = {revision, redo ? PastRevision::Kind::kRedo : PastRevision::Kind::kUndo, by, {}, now(), edit.revision};
  next.entry.summary = (redo ? "makes again revision " : "takes back revision ") + std::to_string(edit.revision);
  next.patch = redo ? edit.forth : edit.back;
  next.appended = {edit.appended.buffers_before, edit.appended.images_before, {}, {}};
  if (redo) next.appended = edit.appended;
  next.done = redo ? done_ + 1 : done_ - 1;
  return next;
}

void History::makeRoom() {
  log_.reserve(log_.size() + 1);
  edits_.reserve(edits_.size() + 1);
}

void History::take(Next next) {
  if (next.entry.kind == PastRevision::Kind::kLoad) {
    log_.clear();
    edits_.clear();
    same_since_ = next.entry.revision;
  }
  std::erase_if(edits_, [&](const auto& edit) { return std::ranges::count(next.forgotten, edit.revision) > 0; });
  if (next.edit) edits_.push_back(std::move(*next.edit));
  done_ = next.done;
  log(std::move(next.entry));
}

bool History::isSameSceneSince(std::uint64_t revision) const {
  return !log_.empty() && revision >= same_since_ && revision <= log_.back().revision;
}

void History::restore(std::vector<PastRevision> log_entries, std::vector<state::Edit> edits, std::size_t done) {
  log_.clear();
  for (auto& entry : log_entries) log(std::move(entry));
  // A load clears the log: what is in it is of one scene, and so is what came right before, but for a load.
  if (!log_.empty()) same_since_ = log_.front().revision - (log_.front().kind == PastRevision::Kind::kLoad ? 0 : 1);
  edits_.assign(std::make_move_iterator(edits.begin()), std::make_move_iterator(edits.end()));
  done_ = done;
}

HistoryReport History::report(std::uint64_t revision) const {
  return {revision, done_, edits_.size() - done_, {log_.begin(), log_.end()}};
}

}  // namespace radiosity::engine
