// What outlived the last process: bringing it back at the start.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/archive.h"
#include "common/log.h"
#include "server/engine/loop/solve_loop_class.h"
#include "server/engine/persist/checkpoint_head.h"
#include "server/engine/persist/kept_settings.h"

namespace radiosity::engine {
namespace {

using nlohmann::json;

/// Tile versions of one process lie below those of the next: enough for six years at twenty a second.
constexpr unsigned kVersionBits = 32;
/// What viewers who come back can be told; as many as the history has revisions.
constexpr std::size_t kResumeBytes = std::size_t{4} << 20;

PastRevision pastRevision(const state::Revision& kept) {
  const auto kind = std::clamp<std::int64_t>(kept.kind, 0, static_cast<std::int64_t>(PastRevision::Kind::kRedo));
  return {kept.revision, static_cast<PastRevision::Kind>(kind), kept.by, kept.summary, kept.time_s, kept.stepped};
}

Error damaged(const std::string& what, const std::filesystem::path& folder) {
  return {ErrorCode::kBadInput,
          "damaged: " + what + "; put a backup of the whole folder in its place, or move the folder away to start anew",
          (folder / "state.sqlite").string()};
}

/// The newest document: the one that was last written whole, and the revisions after it.
Result<scene::Document> newestDocument(state::Kept& kept, const std::filesystem::path& folder) {
  auto& whole = *kept.document;
  scene::Document document{whole.name, json::parse(whole.gltf, nullptr, false), std::move(whole.buffers),
                           std::move(whole.images)};
  if (document.gltf.is_discarded()) return tl::unexpected(damaged("the document is no JSON", folder));
  for (const auto& revision : kept.revisions) {
    if (revision.revision <= kept.document_revision) continue;
    const auto& added = revision.appended;
    if (added.buffers_before > document.buffers.size() || added.images_before > document.images.size())
      return tl::unexpected(damaged(fmt::format("revision {} does not follow", revision.revision), folder));
    try {
      document.gltf.patch_inplace(json::parse(revision.patch));
    } catch (const json::exception& error) {
      return tl::unexpected(damaged(fmt::format("revision {}: {}", revision.revision, error.what()), folder));
    }
    document.buffers.resize(added.buffers_before);
    document.images.resize(added.images_before);
    document.buffers.insert(document.buffers.end(), added.buffers.begin(), added.buffers.end());
    document.images.insert(document.images.end(), added.images.begin(), added.images.end());
  }
  return document;
}

Past pastOf(const state::Kept& kept, const state::Store& store) {
  Past past;
  past.epoch = store.epoch();
  past.first_tile_version = store.runs() << kVersionBits;
  std::size_t bytes = 0;
  for (auto revision = kept.revisions.rbegin(); revision != kept.revisions.rend(); ++revision) {
    bytes += revision->patch.size();
    past.patches_from = revision->revision;
    if (revision->kind == static_cast<std::int64_t>(PastRevision::Kind::kLoad) || bytes > kResumeBytes) break;
    past.patches.insert(past.patches.begin(), {revision->revision, revision->patch, revision->by});
    --past.patches_from;
  }
  for (const auto& answer : kept.answers)
    past.answers.push_back(
        {{answer.request_id, answer.fingerprint}, {answer.revision, answer.surfaces, answer.shots, answer.stepped}});
  return past;
}

}  // namespace

Result<void> SolveLoop::restoreState() {
  if (!options_.store) return {};
  auto& store = *options_.store;
  if (!state::programId().empty() && options_.checkpoint_bytes > 0)
    checkpoints_ = std::make_unique<state::CheckpointWriter>(store.folder() / "checkpoint",
                                                             [kept = options_.store] { return kept->check(); });
  auto kept = store.takeKept();
  settings_ = withKept(settings_, kept.settings, options_.named_settings);
  past_ = pastOf(kept, store);
  publisher_.startAbove(past_.first_tile_version);
  if (!kept.document) return {};
  return restoreScene(std::move(kept));
}

Result<void> SolveLoop::restoreScene(state::Kept kept) {
  const auto folder = options_.store->folder();
  auto document = newestDocument(kept, folder);
  if (!document) return tl::unexpected<Error>(document.error());
  std::vector<PastRevision> log;
  for (const auto& revision : kept.revisions) log.push_back(pastRevision(revision));
  revision_ = log.back().revision;
  history_.restore(std::move(log), std::move(kept.edits), kept.edits_done);
  loaded_digest_ = kept.loaded_digest;
  if (auto lit = restoreSolve(*document); !lit) return lit;
  as_restored_ = true;
  for (const auto& warning : lit_->warnings()) log::warn("{}", warning);
  log::info("{}: {} is back at revision {}, {}", folder.string(), document->name, revision_,
            resumed_shots_ > 0 ? fmt::format("its solve goes on after {} shots", resumed_shots_)
                               : std::string("its solve begins"));
  return {};
}

/// From the checkpoint where it is of use, else from nothing.
Result<void> SolveLoop::restoreSolve(const scene::Document& document) {
  const auto file = options_.store->folder() / "checkpoint";
  auto checkpoint = checkpoints_ ? state::readCheckpoint(file) : Result<std::optional<Bytes>>();
  double seconds = 0.0;
  int layouts = 0;
  if (!checkpoint) {
    log::warn("the solve begins anew: {}", checkpoint.error().text());
  } else if (*checkpoint) {
    auto resumed = withinMemory([&] { return resumedScene(document, **checkpoint); });
    if (resumed) {
      seconds = seconds_;
      layouts = refined_times_;
      if (auto lit = relight(std::move(resumed), Relation::kResumed); !lit) return tl::unexpected<Error>(lit.error());
      resumed_shots_ = lit_->solver().shots();
    } else {
      log::warn("the solve begins anew: {}: {}", file.string(), resumed.error().message);
    }
  }
  if (!lit_) {
    if (auto lit = lightKept(document); !lit) return lit;
  }
  beginSolve();
  seconds_ = seconds;
  refined_times_ = layouts;
  checkpoint_revision_ = resumed_shots_ > 0 ? revision_ : 0;
  checkpoint_shots_ = resumed_shots_;
  return {};
}

/// Texels that were asked for when there was more memory do not keep the server from starting: then those of the
/// command line hold.
Result<void> SolveLoop::lightKept(const scene::Document& document) {
  const auto light = [&](const SolveSettings& settings) {
    auto made = withinMemory([&] { return LitScene::make(document, settings, *transport_, limits_); });
    return relight(std::move(made), Relation::kOther);
  };
  auto lit = light(settings_);
  auto other = settings_;
  other.texels = options_.settings.texels;
  other.texel_size_m = options_.settings.texel_size_m;
  if (other.texels == options_.settings.usualTexels()) other.texels = other.usualTexels();
  if (!lit && lit.error().code == ErrorCode::kTooLarge && keptSettings(other) != keptSettings(settings_)) {
    log::warn("the kept number of texels cannot be lit, that of the command line holds: {}", lit.error().text());
    lit = light(other);
    if (lit) settings_ = other;
  }
  if (!lit) return tl::unexpected<Error>(lit.error());
  return {};
}

Result<std::unique_ptr<LitScene>> SolveLoop::resumedScene(const scene::Document& document, const Bytes& checkpoint) {
  ArchiveReader from(checkpoint);
  CheckpointHead head;
  CheckpointHead::visit(from, head);
  if (!from.ok() || head.epoch != options_.store->epoch())
    return fail(ErrorCode::kBadInput, "it is not of this folder");
  if (!sameSolve(head, headOf(settings_))) return fail(ErrorCode::kBadInput, "it was made with other settings");
  if (head.assets != options_.store->digestOf({{}, {}, document.buffers, document.images}))
    return fail(ErrorCode::kBadInput, fmt::format("it is of revision {}, and has other buffers", head.revision));
  auto then = document;
  const bool is_newest = head.gltf == textOf(document.gltf);
  if (!is_newest) {
    then.gltf = json::parse(head.gltf, nullptr, false);
    then.imported.reset();
  }
  if (then.gltf.is_discarded()) return fail(ErrorCode::kBadInput, "its document is no JSON");
  auto settings = settings_;
  settings.target_error = head.target_error;
  auto lit = LitScene::makeAgain(std::move(then), settings, *transport_, head.sides, head.layout, limits_);
  if (!lit) return lit;
  (*lit)->setDraft(head.draft_error);
  const bool is_same = is_newest && settings_.target_error == head.target_error;
  if (is_same) (*lit)->setCloser(head.closer);  // else texels are to follow what has changed
  refined_times_ = is_same ? static_cast<int>(std::min<std::uint32_t>(head.layouts, kMostLayouts)) : 0;
  (void)(*lit)->startSolve();
  if (!(*lit)->restore(from)) return fail(ErrorCode::kBadInput, "it does not fit the scene");
  if (!is_newest) {  // the solve can take in whatever has changed of light and colour since
    auto scene = scene::importScene(document, limits_);
    if (!scene) return tl::unexpected<Error>(scene.error());
    configureScene(*scene, settings);
    const auto change = (*lit)->changeTo(*scene);
    if (change.geometry)
      return fail(ErrorCode::kBadInput, fmt::format("it is of revision {}, whose geometry is not that of revision {}",
                                                    head.revision, revision_));
    (*lit)->reshade(document, std::make_shared<const scene::Scene>(std::move(*scene)), change);
  }
  if (settings_.target_error != head.target_error) (*lit)->retarget(settings_);
  seconds_ = is_newest ? head.seconds : 0.0;
  return lit;
}

bool SolveLoop::isAsLoaded() const { return as_restored_ && history_.report(revision_).revisions.size() == 1; }

std::function<bool(const scene::Document&)> SolveLoop::comparison() const {
  return [store = options_.store, digest = loaded_digest_](const scene::Document& document) {
    return store->digestOf(plainDocument(document)) == digest;
  };
}

/// What was kept was promised to those who made it: a restart with the same command must not take it from them.
void SolveLoop::openFile(std::string path, bool anew, Callback<LoadOutcome> done) {
  load({}, std::move(done), [this, path = std::move(path), anew](LoadJob::Request& request) {
    request.read = [path, limits = limits_] { return scene::loadDocument(path, limits); };
    if (!as_restored_ || anew) return;
    request.goes_on_edited = true;
    request.is_known = [is_same = comparison(), path, revision = revision_](const scene::Document& document) {
      if (!is_same(document))
        log::warn(
            "{} is not what the kept scene came from: it has changed, or a client loaded another. The kept scene goes "
            "on "
            "at revision {}; --reload takes {} in its place",
            path, revision, path);
      return true;
    };
  });
}

}  // namespace radiosity::engine
