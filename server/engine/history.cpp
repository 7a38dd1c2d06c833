#include "server/engine/history.h"

#include <algorithm>
#include <chrono>
#include <utility>

#include "common/check.h"
#include "server/scene/json_patch.h"

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

std::string textOf(const json& patch) { return patch.dump(-1, ' ', false, json::error_handler_t::replace); }

std::vector<SharedBytes> appended(const std::vector<SharedBytes>& before, const std::vector<SharedBytes>& after) {
  return {after.begin() + static_cast<std::ptrdiff_t>(std::min(before.size(), after.size())), after.end()};
}

}  // namespace

void History::log(PastRevision entry) {
  entry.time_s = now();
  log_.push_back(std::move(entry));
  if (log_.size() > bounds_.revisions) log_.pop_front();
}

std::size_t History::patchBytes() const {
  std::size_t bytes = 0;
  for (const auto& edit : edits_) bytes += edit.bytes();
  return bytes;
}

void History::loaded(std::uint64_t revision, const std::string& name) {
  log_.clear();
  edits_.clear();
  done_ = 0;
  log({revision, PastRevision::Kind::kLoad, {}, shortened(name)});
}

void History::edited(std::uint64_t revision, const std::string& by, const json& patch, const scene::Document& before,
                     const scene::Document& after) {
  edits_.erase(edits_.begin() + static_cast<std::ptrdiff_t>(done_), edits_.end());
  Edit edit;
  edit.revision = revision;
  edit.forth = textOf(scene::diffJson(before.gltf, after.gltf));
  edit.back = textOf(scene::diffJson(after.gltf, before.gltf));
  edit.buffers = appended(before.buffers, after.buffers);
  edit.images = appended(before.images, after.images);
  edit.buffers_before = before.buffers.size();
  edit.images_before = before.images.size();
  edits_.push_back(std::move(edit));
  while (!edits_.empty() && (edits_.size() > bounds_.edits || patchBytes() > bounds_.patch_bytes)) edits_.pop_front();
  done_ = edits_.size();
  log({revision, PastRevision::Kind::kPatch, by, summaryOf(patch)});
}

Result<History::Step> History::step(bool redo, const scene::Document& now) const {
  if (redo ? done_ == edits_.size() : done_ == 0)
    return fail(ErrorCode::kNotFound, redo ? "there is no edit to make again" : "there is no edit to take back");
  const auto& edit = edits_[redo ? done_ : done_ - 1];
  Step step{now, redo ? edit.forth : edit.back, edit.revision};
  step.document.gltf.patch_inplace(json::parse(step.patch));  // our own, of just this document
  auto& [name, gltf, buffers, images] = step.document;
  buffers.resize(edit.buffers_before);
  images.resize(edit.images_before);
  if (redo) {
    buffers.insert(buffers.end(), edit.buffers.begin(), edit.buffers.end());
    images.insert(images.end(), edit.images.begin(), edit.images.end());
  }
  return step;
}

void History::stepped(std::uint64_t revision, const std::string& by, bool redo) {
  RAD_CHECK(redo ? done_ < edits_.size() : done_ > 0);
  const auto edit = edits_[redo ? done_++ : --done_].revision;
  for (auto& entry : log_) {
    if (entry.kind == PastRevision::Kind::kPatch && entry.revision == edit) entry.undone = !redo;
  }
  PastRevision entry{revision, redo ? PastRevision::Kind::kRedo : PastRevision::Kind::kUndo, by, {}};
  entry.summary = (redo ? "makes again revision " : "takes back revision ") + std::to_string(edit);
  entry.stepped = edit;
  log(std::move(entry));
}

HistoryReport History::report(std::uint64_t revision) const {
  return {revision, done_, edits_.size() - done_, {log_.begin(), log_.end()}};
}

}  // namespace radiosity::engine
