// What changes the scene or the solve: loading, patching, settings, pause.
#include <algorithm>
#include <utility>

#include "common/log.h"
#include "server/engine/solve_loop_class.h"

namespace radiosity::engine {

Engine::Callback<LoadOutcome> SolveLoop::countLoad(Callback<LoadOutcome> done) {
  ++loads_;
  return [this, done = std::move(done)](Result<LoadOutcome> outcome) {
    --loads_;
    done(std::move(outcome));
  };
}

void SolveLoop::loadBytes(std::string name, SharedBytes bytes, Callback<LoadOutcome> done) {
  ask<LoadOutcome>(countLoad(std::move(done)), [this, name = std::move(name), bytes = std::move(bytes)] {
    return install(scene::parseDocument(name, *bytes));
  });
}

void SolveLoop::loadFile(std::string path, Callback<LoadOutcome> done) {
  ask<LoadOutcome>(countLoad(std::move(done)),
                   [this, path = std::move(path)] { return install(scene::loadDocument(path)); });
}

Result<LoadOutcome> SolveLoop::install(Result<scene::Document> document) {
  if (!document) return tl::unexpected<Error>(document.error());
  if (goesOnWith(*document, false)) return LoadOutcome{revision_, lit_->warnings()};
  const SolveState before = std::exchange(state_, SolveState::kLoading);
  updateStatus(true);
  auto next = History::nextLoad(revision_ + 1, document->name);
  const auto keep = [&](const LitScene& made, const LitScene::Affected&) { return keepLoad(next, made.document()); };
  auto made = withinMemory([&] { return LitScene::make(std::move(*document), settings_, *transport_); });
  const auto lit = relight(std::move(made), Relation::kOther, keep);
  if (!lit) {
    if (state_ == SolveState::kLoading) state_ = before;
    updateStatus(true);
    return tl::unexpected<Error>(lit.error());
  }
  ++revision_;
  history_.take(std::move(next));
  const LogScope about({.revision = revision_});
  for (const auto& warning : lit_->warnings()) log::warn("{}", warning);
  beginSolve();
  listeners_.tell([this](Listener& listener) { listener.onSceneLoaded(revision_); });
  publishLightmaps(false);
  return LoadOutcome{revision_, lit_->warnings()};
}

Result<LitScene::Affected> SolveLoop::relight(Result<std::unique_ptr<LitScene>> made, Relation relation,
                                              const KeepMade& keep) {
  if (!made) return tl::unexpected<Error>(made.error());
  auto* former = relation == Relation::kEdited || relation == Relation::kSolvedAnew ? lit_.get() : nullptr;
  auto affected = withinMemory([&] { return tryOut(**made, former, keep); });
  // What a solve that failed has measured may be a part of what it thinks it has.
  auto* measured = state_ == SolveState::kFailed || relation == Relation::kSolvedAnew ? nullptr : former;
  const bool starts = affected && relation != Relation::kResumed;
  if (starts) affected = startSolveOf(**made, *affected, measured);
  if (!affected) {
    made->reset();    // before the other takes its place again
    putBack(starts);  // it may have had the links already
    return affected;
  }
  // The links are taken, the patches are still there to be compared.
  if (former == nullptr || !(*made)->keepsLayoutOf(*former)) publisher_.reset();
  lit_ = std::move(*made);
  renderer_lost_ = false;  // it took the scene
  return affected;
}

Result<LitScene::Affected> SolveLoop::tryOut(LitScene& made, LitScene* former, const KeepMade& keep) {
  if (auto uploaded = made.upload(); !uploaded) return tl::unexpected<Error>(uploaded.error());
  LitScene::Affected affected;
  if (former != nullptr) {
    affected = made.succeed(*former);
    made.fadeFrom(*former, made.keepsLayoutOf(*former));
  }
  if (auto kept = keep ? keep(made, affected) : Result<void>(); !kept) return tl::unexpected<Error>(kept.error());
  return affected;
}

Result<LitScene::Affected> SolveLoop::startSolveOf(LitScene& made, LitScene::Affected affected, LitScene* measured) {
  try {
    affected.shots = made.startSolve(measured);
    return affected;
  } catch (const std::bad_alloc&) {
    log::warn("no memory for the links of the solve before: all is measured anew");
  }
  return withinMemory([&]() -> Result<LitScene::Affected> {
    affected.shots = made.startSolve();
    return affected;
  });
}

void SolveLoop::putBack(bool anew) {
  if (!lit_) return;
  const auto back = withinMemory([&] {
    if (anew) lit_->restart(settings_);
    return lit_->upload();
  });
  if (back && !anew) return;
  if (back) return beginSolve();
  failure_ = back.error().text();
  endSolve(SolveState::kFailed);
}

void SolveLoop::patch(PatchRequest request, Callback<PatchOutcome> done) {
  askLit<PatchOutcome>(std::move(done), [this, request = std::move(request)] { return applyRequest(request); });
}

void SolveLoop::step(StepRequest request, Callback<PatchOutcome> done) {
  askLit<PatchOutcome>(std::move(done), [this, request = std::move(request)] { return applyStep(request); });
}

void SolveLoop::history(Callback<HistoryReport> done) {
  ask<HistoryReport>(std::move(done), [this]() -> Result<HistoryReport> { return history_.report(revision_); });
}

Result<void> SolveLoop::checkBase(const std::optional<std::uint64_t>& base_revision) const {
  if (!base_revision || *base_revision == revision_) return {};
  return fail(ErrorCode::kStaleRevision,
              "the scene is at revision " + std::to_string(revision_) + ", not " + std::to_string(*base_revision));
}

Result<PatchOutcome> SolveLoop::applyRequest(const PatchRequest& request) {
  if (auto ok = checkBase(request.base_revision); !ok) return tl::unexpected<Error>(ok.error());
  const auto patch = nlohmann::json::parse(request.patch, nullptr, false);
  if (patch.is_discarded()) return fail(ErrorCode::kBadInput, "the patch is not JSON");
  auto edited = scene::editDocument(lit_->document(), patch, request.find_upload);
  if (!edited) return tl::unexpected<Error>(edited.error());
  if (request.dry_run) {
    const auto change = lit_->changeTo(edited->scene);
    return PatchOutcome{revision_, lit_->affectedBy(change, edited->scene),
                        change.geometry ? lit_->solver().shots() : 0};
  }
  auto next = history_.nextEdit(revision_ + 1, request.by, patch, lit_->document(), edited->document);
  const auto keep = keepEdit(next, request.receipt, edited->document);
  const auto outcome = adopt(std::move(*edited), keep);
  if (!outcome) return outcome;
  history_.take(std::move(next));
  announceEdit(*outcome, request.patch, request.by);
  return outcome;
}

Result<PatchOutcome> SolveLoop::applyStep(const StepRequest& request) {
  if (auto ok = checkBase(request.base_revision); !ok) return tl::unexpected<Error>(ok.error());
  auto step = history_.step(request.redo, lit_->document());
  if (!step) return tl::unexpected<Error>(step.error());
  auto scene = scene::importScene(step->document);
  if (!scene) return tl::unexpected<Error>(scene.error());
  auto next = history_.nextStep(revision_ + 1, request.by, request.redo);
  const auto keep = keepEdit(next, request.receipt, step->document);
  auto outcome = adopt({std::move(step->document), std::move(*scene)}, keep);
  if (!outcome) return outcome;
  outcome->stepped = step->edit;
  history_.take(std::move(next));
  announceEdit(*outcome, step->patch, request.by);
  return outcome;
}

Result<PatchOutcome> SolveLoop::adopt(scene::EditedDocument edited, const Keep& keep) {
  const auto change = lit_->changeTo(edited.scene);
  PatchOutcome outcome;
  outcome.revision = revision_ + 1;
  if (change.geometry) {
    auto rebuilt = rebuild(std::move(edited), keep);
    if (!rebuilt) return rebuilt;
    outcome = *rebuilt;
  } else {
    outcome.affected_surfaces = lit_->affectedBy(change, edited.scene);
    if (auto kept = keep(outcome); !kept) return tl::unexpected<Error>(kept.error());
    outcome.affected_surfaces = lit_->reshade(std::move(edited), change);
    if (outcome.affected_surfaces > 0) takeInLight();
  }
  outcome.revision = ++revision_;
  return outcome;
}

/// The solver was told of other light or materials.
void SolveLoop::takeInLight() {
  // The light of the wave that failed is counted as shot but arrived nowhere.
  if (state_ == SolveState::kFailed) lit_->restart(settings_);
  // It takes an edit in with its next step, which does not come: show what can be shown.
  if (state_ == SolveState::kPaused) lit_->solver().assess();
}

Result<PatchOutcome> SolveLoop::rebuild(scene::EditedDocument edited, const Keep& keep) {
  PatchOutcome outcome;
  outcome.revision = revision_ + 1;
  const auto set = [&](const LitScene::Affected& affected) {
    outcome.affected_shots = affected.shots;
    outcome.affected_surfaces = std::max<std::uint64_t>(affected.surfaces, 1);  // pages are new even if empty
  };
  // How many shots it touches is known when their links have gone over, after which there is no way back.
  const auto keep_made = [&](const LitScene&, const LitScene::Affected& at_most) {
    set(at_most);
    return keep(outcome);
  };
  auto made = LitScene::make(std::move(edited), settings_, *transport_, lit_.get());
  const auto affected = relight(std::move(made), Relation::kEdited, keep_made);
  if (!affected) return tl::unexpected<Error>(affected.error());
  set(*affected);
  correctAnswer(outcome);
  return outcome;
}

void SolveLoop::announceEdit(const PatchOutcome& outcome, const std::string& patch, const std::string& by) {
  listeners_.tell([&](Listener& listener) { listener.onScenePatched(outcome.revision, patch, by); });
  if (outcome.affected_surfaces > 0) {
    beginSolve();
  } else {
    updateStatus(true);
  }
  publishLightmaps(false);
}

void SolveLoop::configure(ChangeSettings change, Callback<SolveSettings> done) {
  ask<SolveSettings>(std::move(done), [this, change = std::move(change)] { return applySettings(change(settings_)); });
}

Result<SolveSettings> SolveLoop::applySettings(const SolveSettings& settings) {
  const SolveSettings before = settings_;
  const bool resized = before.texels != settings.texels || before.texel_size_m != settings.texel_size_m;
  const bool anew = before.seed != settings.seed || before.paper_mode != settings.paper_mode ||
                    before.link_memory_bytes != settings.link_memory_bytes;
  if (lit_ && resized) {  // which may fail: only what can be lit is kept
    const auto keep = [&](const LitScene&, const LitScene::Affected&) { return keepSettings(settings); };
    auto made = withinMemory([&] { return LitScene::make(lit_->document(), settings, *transport_); });
    const auto relation = anew ? Relation::kSolvedAnew : Relation::kEdited;
    if (const auto lit = relight(std::move(made), relation, keep); !lit) {
      updateStatus(true);
      return tl::unexpected<Error>(lit.error());
    }
  } else if (auto kept = keepSettings(settings); !kept) {
    return tl::unexpected<Error>(kept.error());
  }
  settings_ = settings;
  if (!lit_) {  // they wait for a scene
    updateStatus(true);
    return settings_;
  }
  if (resized) {
    beginSolve();
    listeners_.tell([this](Listener& listener) { listener.onSceneLoaded(revision_); });
    publishLightmaps(false);
  } else if (anew) {
    lit_->restart(settings);
    beginSolve();
  } else {
    lit_->retarget(settings);
    if (before.sky != settings.sky && lit_->setSky(settings)) {
      takeInLight();
      beginSolve();
      publishLightmaps(false);
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
