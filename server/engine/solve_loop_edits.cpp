// What changes the scene or the solve: loading, patching, settings, pause.
#include <algorithm>
#include <utility>

#include "common/log.h"
#include "server/engine/solve_loop_class.h"

namespace radiosity::engine {

void SolveLoop::loadBytes(std::string name, SharedBytes bytes, Callback<LoadOutcome> done) {
  ask<LoadOutcome>(std::move(done), [this, name = std::move(name), bytes = std::move(bytes)] {
    return install(scene::parseDocument(name, *bytes));
  });
}

void SolveLoop::loadFile(std::string path, Callback<LoadOutcome> done) {
  ask<LoadOutcome>(std::move(done), [this, path = std::move(path)] { return install(scene::loadDocument(path)); });
}

Result<LoadOutcome> SolveLoop::install(Result<scene::Document> document) {
  if (!document) return tl::unexpected<Error>(document.error());
  const SolveState before = std::exchange(state_, SolveState::kLoading);
  updateStatus(true);
  if (const auto lit = relight(std::move(*document), settings_); !lit) {
    if (state_ == SolveState::kLoading) state_ = before;
    updateStatus(true);
    return tl::unexpected<Error>(lit.error());
  }
  ++revision_;
  for (const auto& warning : lit_->warnings()) log::warn("{}", warning);
  beginSolve();
  listeners_.tell([this](Listener& listener) { listener.onSceneLoaded(revision_); });
  publishLightmaps(false);
  return LoadOutcome{revision_, lit_->warnings()};
}

Result<void> SolveLoop::relight(scene::Document document, const SolveSettings& settings) {
  auto made = LitScene::make(std::move(document), settings, *transport_);
  if (!made) return tl::unexpected<Error>(made.error());
  if (auto uploaded = (*made)->upload(); !uploaded) {
    if (lit_) {
      if (const auto back = lit_->upload(); !back) {
        failure_ = back.error().text();
        endSolve(SolveState::kFailed);
      }
    }
    return uploaded;
  }
  lit_ = std::move(*made);
  publisher_.reset();
  return {};
}

void SolveLoop::patch(PatchRequest request, Callback<PatchOutcome> done) {
  askLit<PatchOutcome>(std::move(done), [this, request = std::move(request)] { return applyRequest(request); });
}

Result<PatchOutcome> SolveLoop::applyRequest(const PatchRequest& request) {
  if (request.base_revision && *request.base_revision != revision_) {
    return fail(ErrorCode::kStaleRevision, "the scene is at revision " + std::to_string(revision_) + ", not " +
                                               std::to_string(*request.base_revision));
  }
  const auto patch = nlohmann::json::parse(request.patch, nullptr, false);
  if (patch.is_discarded()) return fail(ErrorCode::kBadInput, "the patch is not JSON");
  auto next = scene::applyPatch(lit_->document(), patch);
  if (!next) return tl::unexpected<Error>(next.error());
  if (request.dry_run) {
    const auto imported = scene::importScene(*next);
    if (!imported) return tl::unexpected<Error>(imported.error());
    return PatchOutcome{revision_, 0, 0};
  }
  const auto change = lit_->changeTo(*next);
  auto outcome = change == LitScene::Change::kGeometry ? rebuild(std::move(*next)) : reshade(std::move(*next), change);
  if (!outcome) return outcome;
  outcome->revision = ++revision_;
  listeners_.tell([&](Listener& listener) { listener.onScenePatched(revision_, request.patch, request.by); });
  if (outcome->affected_surfaces > 0) {
    beginSolve();
  } else {
    updateStatus(true);
  }
  publishLightmaps(false);
  return outcome;
}

Result<PatchOutcome> SolveLoop::rebuild(scene::Document next) {
  PatchOutcome outcome;
  outcome.affected_shots = lit_->solver().shots();
  outcome.affected_surfaces = lit_->patches().surfaces.size();
  if (const auto lit = relight(std::move(next), settings_); !lit) return tl::unexpected<Error>(lit.error());
  outcome.affected_surfaces = std::max<std::uint64_t>(outcome.affected_surfaces, lit_->patches().surfaces.size());
  return outcome;
}

Result<PatchOutcome> SolveLoop::reshade(scene::Document next, LitScene::Change change) {
  const auto affected = lit_->reshade(std::move(next), change);
  if (!affected) return tl::unexpected<Error>(affected.error());
  // The light of the wave that failed is counted as shot but arrived nowhere.
  if (*affected > 0 && state_ == SolveState::kFailed) lit_->restart(settings_);
  PatchOutcome outcome;
  outcome.affected_surfaces = *affected;
  return outcome;
}

void SolveLoop::configure(SolveSettings settings, Callback<SolveSettings> done) {
  ask<SolveSettings>(std::move(done), [this, settings] { return applySettings(settings); });
}

Result<SolveSettings> SolveLoop::applySettings(const SolveSettings& settings) {
  const SolveSettings before = std::exchange(settings_, settings);
  if (!lit_) {  // they wait for a scene
    updateStatus(true);
    return settings_;
  }
  if (before.texels != settings.texels || before.texel_size_m != settings.texel_size_m) {
    if (const auto lit = relight(lit_->document(), settings); !lit) {
      settings_ = before;
      updateStatus(true);
      return tl::unexpected<Error>(lit.error());
    }
    beginSolve();
    listeners_.tell([this](Listener& listener) { listener.onSceneLoaded(revision_); });
    publishLightmaps(false);
  } else if (before.seed != settings.seed || before.paper_mode != settings.paper_mode ||
             before.link_memory_bytes != settings.link_memory_bytes) {
    lit_->restart(settings);
    beginSolve();
  } else {
    lit_->retarget(settings);
    if (before.sky != settings.sky && lit_->setSky(settings)) {
      beginSolve();
    } else {
      reconsiderStop();
      updateStatus(true);
    }
  }
  return settings_;
}

void SolveLoop::reconsiderStop() {
  if (state_ != SolveState::kConverged && state_ != SolveState::kTimeLimit && state_ != SolveState::kLimited) return;
  const bool reached = lit_->solver().error().total <= settings_.target_error;
  if (state_ == SolveState::kLimited && !reached) return;
  failure_.clear();
  const bool out_of_time = settings_.time_limit_s && seconds_ >= *settings_.time_limit_s;
  const SolveState now = reached ? SolveState::kConverged : out_of_time ? SolveState::kTimeLimit : SolveState::kSolving;
  if (now == state_) return;
  if (now == SolveState::kSolving) {
    state_ = now;
  } else {
    endSolve(now);
  }
}

void SolveLoop::pause(Callback<SolveState> done) {
  ask<SolveState>(std::move(done), [this]() -> Result<SolveState> {
    if (state_ == SolveState::kSolving) state_ = SolveState::kPaused;
    updateStatus(true);
    return state_;
  });
}

void SolveLoop::resume(Callback<SolveState> done) {
  ask<SolveState>(std::move(done), [this]() -> Result<SolveState> {
    if (state_ == SolveState::kPaused) state_ = SolveState::kSolving;
    updateStatus(true);
    return state_;
  });
}

void SolveLoop::restart(Callback<SolveState> done) {
  askLit<SolveState>(std::move(done), [this]() -> Result<SolveState> {
    lit_->restart(settings_);
    state_ = SolveState::kSolving;
    beginSolve();
    return state_;
  });
}

}  // namespace radiosity::engine
