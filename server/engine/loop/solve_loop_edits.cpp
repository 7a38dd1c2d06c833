// What changes the scene or the solve: patching, settings, pause.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "common/log.h"
#include "common/parallel.h"
#include "server/engine/loop/solve_loop_class.h"

namespace radiosity::engine {

Result<LitScene::Affected> SolveLoop::relight(Result<std::unique_ptr<LitScene>> made, Relation relation,
                                              const KeepMade& keep, Upload upload) {
  if (!made) return tl::unexpected<Error>(made.error());
  const bool is_anew = relation == Relation::kSolvedAnew || relation == Relation::kRefined;
  auto* former = relation == Relation::kEdited || is_anew ? lit_.get() : nullptr;
  // What a solve that failed has measured may be a part of what it thinks it has.
  const bool is_whole = state_ != SolveState::kFailed && !(lit_ && lit_->isStale());
  auto* measured = is_whole && !is_anew ? former : nullptr;
  const bool starts = relation != Relation::kResumed;
  bool keeps_layout = false;
  auto affected =
      withinMemory([&] { return tryOut(**made, former, starts && measured == nullptr, keep, upload, keeps_layout); });
  if (!affected) {
    made->reset();  // before the other takes its place again
    if (upload != Upload::kNever) putBack();
    return affected;
  }
  if (!keeps_layout) publisher_.reset();
  probes_.letGo();
  renderer_lost_ = renderer_lost_ && upload == Upload::kNever;  // or else it took the scene
  if (starts && measured != nullptr) return LitScene::Affected{affected->surfaces, takeLinks(std::move(*made))};
  disposer_.dispose(std::exchange(former_, nullptr));
  auto before = std::exchange(lit_, std::move(*made));
  // Of two that were measured the better one stays beside the third.
  const bool keeps_coarser = before && before->surfaceError() && isWorseThanCoarser(before->surfaceError()->total);
  if (relation == Relation::kRefined && !keeps_coarser) before = std::exchange(coarser_, std::move(before));
  disposer_.dispose(std::move(before));
  return affected;
}

Result<LitScene::Affected> SolveLoop::tryOut(LitScene& made, LitScene* former, bool solve_anew, const KeepMade& keep,
                                             Upload upload, bool& keeps_layout) {
  Result<void> begun;
  LitScene::Affected affected;
  const auto begin = [&](std::size_t part) {  // the transport is this thread's alone
    if (part == 0 && upload == Upload::kNow) begun = made.beginUpload();
    if (part == 1 && former != nullptr) affected = made.succeed(*former);
  };
  doShares(2, ShareOfWork(begin));
  if (!begun) return tl::unexpected<Error>(begun.error());
  if (former != nullptr) {
    keeps_layout = made.keepsLayoutOf(*former);
    made.fadeFrom(*former, keeps_layout);
  }
  if (upload != Upload::kNever)
    if (auto uploaded = made.finishUpload(); !uploaded) return tl::unexpected<Error>(uploaded.error());
  if (solve_anew) (void)made.startSolve();
  if (auto kept = keep ? keep(made, affected) : Result<void>(); !kept) return tl::unexpected<Error>(kept.error());
  return affected;
}

std::uint64_t SolveLoop::takeLinks(std::unique_ptr<LitScene> made) {
  std::uint64_t shots = 0;
  former_.reset();
  if (isWorthKeeping(*lit_) && fitsMemory([&] { shots = made->startSolve(lit_.get(), true); })) {
    former_ = std::exchange(lit_, std::move(made));
    return shots;
  }
  if (fitsMemory([&] { shots = made->startSolve(lit_.get()); })) {
    disposer_.dispose(std::exchange(lit_, std::move(made)));
    return shots;
  }
  log::warn("no memory for the links of the solve before: all is measured anew");
  shots = lit_->solver().shots();
  lit_.reset();  // what it held is needed
  (void)disposer_.drain();
  if (fitsMemory([&] { (void)made->startSolve(); })) {
    lit_ = std::move(made);
    return shots;
  }
  made.reset();
  const bool told = fitsMemory([&] {
    failure_ = "what was asked is made, but " + outOfMemory().value().message;
    log::error("solve stopped: {}", failure_);
    unload(SolveState::kFailed);
  });
  if (!told) state_ = SolveState::kFailed;
  return shots;
}

void SolveLoop::putBack() {
  if (!lit_ || first_light_) return;
  const auto back = withinMemory([&] { return lit_->upload(); });
  if (back) return;
  failure_ = back.error().text();
  endSolve(SolveState::kFailed);
}

void SolveLoop::patch(PatchRequest request, Callback<PatchOutcome> done) {
  const auto session = request.session;
  askOf<PatchOutcome>(Needs::kWhole, session, std::move(done),
                      [this, request = std::move(request)]() -> Result<PatchOutcome> {
                        if (!lit_) return noScene();
                        return applyRequest(request);
                      });
}

void SolveLoop::step(StepRequest request, Callback<PatchOutcome> done) {
  const auto session = request.session;
  askOf<PatchOutcome>(Needs::kWhole, session, std::move(done),
                      [this, request = std::move(request)]() -> Result<PatchOutcome> {
                        if (!lit_) return noScene();
                        return applyStep(request);
                      });
}

void SolveLoop::history(Callback<HistoryReport> done) {
  ask<HistoryReport>(std::move(done), [this]() -> Result<HistoryReport> { return history_.report(revision_); });
}

Result<void> SolveLoop::checkBase(const std::optional<std::uint64_t>& base_revision) const {
  if (!base_revision || *base_revision == revision_) return {};
  return fail(ErrorCode::kStaleRevision,
              "the scene is at revision " + std::to_string(revision_) + ", not " + std::to_string(*base_revision));
}

/// Indices of an edit mean other objects in another scene.
Result<void> SolveLoop::checkScene(const std::optional<std::uint64_t>& same_scene_as) const {
  if (!same_scene_as || history_.isSameSceneSince(*same_scene_as)) return {};
  return fail(ErrorCode::kStaleRevision,
              fmt::format("revision {} is of another scene than the present one", *same_scene_as));
}

Result<PatchOutcome> SolveLoop::applyRequest(const PatchRequest& request) {
  edit_began_ = Clock::now();
  if (auto ok = checkBase(request.base_revision); !ok) return tl::unexpected<Error>(ok.error());
  if (auto ok = checkScene(request.same_scene_as); !ok) return tl::unexpected<Error>(ok.error());
  const auto patch = nlohmann::json::parse(request.patch, nullptr, false);
  if (patch.is_discarded()) return fail(ErrorCode::kBadInput, "the patch is not JSON");
  auto edited = scene::editDocument(lit_->document(), patch, request.find_upload, limits_);
  if (!edited) return tl::unexpected<Error>(edited.error());
  configureScene(edited->scene, settings_);
  if (request.dry_run) {
    const auto change = lit_->changeTo(edited->scene);
    return PatchOutcome{revision_, lit_->affectedBy(change, edited->scene),
                        change.geometry ? lit_->solver().shots() : 0};
  }
  auto next = history_.nextEdit(revision_ + 1, request.by, patch, lit_->document(), edited->document, edited->parts);
  const auto keep = keepEdit(next, request.receipt, edited->document);
  const auto outcome = adopt(std::move(*edited), keep);
  if (!outcome) return outcome;
  history_.take(std::move(next));
  announceEdit(*outcome, request.patch, request.by);
  return outcome;
}

Result<PatchOutcome> SolveLoop::applyStep(const StepRequest& request) {
  edit_began_ = Clock::now();
  if (auto ok = checkBase(request.base_revision); !ok) return tl::unexpected<Error>(ok.error());
  auto step = history_.step(request.redo, lit_->document());
  if (!step) return tl::unexpected<Error>(step.error());
  auto edited = scene::importEdited(std::move(step->document), &lit_->document(), limits_);
  if (!edited) return tl::unexpected<Error>(edited.error());
  configureScene(edited->scene, settings_);
  auto next = history_.nextStep(revision_ + 1, request.by, request.redo);
  const auto keep = keepEdit(next, request.receipt, edited->document);
  auto outcome = adopt(std::move(*edited), keep);
  if (!outcome) return outcome;
  outcome->stepped = step->edit;
  history_.take(std::move(next));
  announceEdit(*outcome, step->patch, request.by);
  return outcome;
}

/// `tell` tells the solver of other light or materials; it returns whether that changes the light. What is told is on
/// the disk: where memory runs out the solve starts over, now or with its next slice, and false is returned.
bool SolveLoop::takeInLight(const std::function<bool()>& tell) {
  const bool told = fitsMemory([&] {
    if (!tell()) return;
    // The light of the wave that failed is counted as shot but arrived nowhere.
    if (state_ == SolveState::kFailed) lit_->invalidate();
    if (lit_->isStale()) return lit_->restart(settings_);
    // It takes an edit in with its next step, which does not come: show what can be shown.
    if (state_ == SolveState::kPaused) lit_->solver().assess();
  });
  if (told) return true;
  log::warn("out of memory: the solve starts over");
  lit_->invalidate();
  (void)fitsMemory([&] { lit_->restart(settings_); });
  return false;
}

Result<PatchOutcome> SolveLoop::adopt(scene::EditedDocument edited, const Keep& keep) {
  const auto change = lit_->changeTo(edited.scene);
  PatchOutcome outcome;
  outcome.revision = revision_ + 1;
  history_.makeRoom();
  if (change.geometry) {
    auto rebuilt = rebuild(std::move(edited), keep);
    if (!rebuilt) return rebuilt;
    outcome = *rebuilt;
  } else {
    outcome.affected_surfaces = lit_->affectedBy(change, edited.scene);
    auto scene = std::make_shared<const scene::Scene>(std::move(edited.scene));
    if (auto kept = keep(outcome); !kept) return tl::unexpected<Error>(kept.error());
    const bool taken = takeInLight([&] {
      retired_ = lit_->reshade(std::move(edited.document), std::move(scene), change);
      return outcome.affected_surfaces > 0;
    });
    if (!taken) outcome.affected_surfaces = std::max<std::uint64_t>(outcome.affected_surfaces, 1);  // all, in truth
  }
  outcome.revision = ++revision_;
  return outcome;
}

Result<PatchOutcome> SolveLoop::rebuild(scene::EditedDocument edited, const Keep& keep) {
  if (former_) {
    const auto change = former_->changeTo(edited.scene);
    if (!change.geometry) {
      auto outcome = goBack(std::move(edited), change, keep);
      if (outcome) shown_is_own_ = false;
      return outcome;
    }
  }
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
  const auto affected = relight(std::move(made), Relation::kEdited, keep_made, uploadOfEdit());
  if (!affected) return tl::unexpected<Error>(affected.error());
  set(*affected);
  if (!fitsMemory([&] { correctAnswer(outcome); }))
    log::warn("out of memory: an edit's answer stays as it was first kept");
  return outcome;
}

void SolveLoop::announceEdit(const PatchOutcome& outcome, const std::string& patch, const std::string& by) {
  const auto tell = [&] {
    listeners_.tell([&](Listener& listener) { listener.onScenePatched(outcome.revision, patch, by); });
  };
  const auto tell_to_fetch = [&] {
    listeners_.tell([&](Listener& listener) { listener.onSceneLoaded(outcome.revision); });
  };
  if (!fitsMemory(tell) && !fitsMemory(tell_to_fetch)) log::error("out of memory: viewers are not told of an edit");
  const bool shown = fitsMemory([&] {
    if (lit_ && outcome.affected_surfaces > 0) {
      beginSolve();
    } else {
      dropRefinement();  // it is of the document before
      updateStatus(true);
    }
    showEdit();
  });
  if (state_ != SolveState::kSolving) disposer_.dispose(std::exchange(retired_, nullptr));  // no slice follows
  if (shown) return;
  unpublished_ = true;
  log::warn("out of memory: an edit will be shown later");
}

void SolveLoop::configure(ChangeSettings change, Callback<SolveSettings> done) {
  askOf<SolveSettings>(Needs::kNoLoad, 0, std::move(done),
                       [this, change = std::move(change)] { return applySettings(change(settings_)); });
}

Result<SolveSettings> SolveLoop::applySettings(const SolveSettings& settings) {
  if (settings == settings_) return settings_;  // who asks what they are changes nothing
  const SolveSettings before = settings_;
  const bool reshaped = before.texels != settings.texels || before.texel_size_m != settings.texel_size_m ||
                        before.double_sided != settings.double_sided ||
                        before.choosesTexels() != settings.choosesTexels() ||
                        (lit_ && before.sky != settings.sky && lit_->outgrows(settings));
  const bool anew = before.seed != settings.seed || before.method != settings.method ||
                    before.link_memory_bytes != settings.link_memory_bytes;
  if (lit_ && reshaped) {  // which may fail: only what can be lit is kept
    const auto keep = [&](const LitScene&, const LitScene::Affected&) { return keepSettings(settings); };
    auto made = withinMemory([&] { return LitScene::make(lit_->document(), settings, *transport_, limits_); });
    const auto relation = anew ? Relation::kSolvedAnew : Relation::kEdited;
    if (const auto lit = relight(std::move(made), relation, keep, uploadOfEdit()); !lit) {
      updateStatus(true);
      return tl::unexpected<Error>(lit.error());
    }
  } else if (auto kept = keepSettings(settings); !kept) {
    return tl::unexpected<Error>(kept.error());
  }
  settings_ = settings;
  if (!fitsMemory([&] { takeSettings(before, reshaped, anew); })) {
    unpublished_ = true;
    log::warn("out of memory: settings are told of later");
  }
  return settings_;
}

/// They are kept: nothing can be refused any more.
void SolveLoop::takeSettings(const SolveSettings& before, bool reshaped, bool anew) {
  former_.reset();                       // its solve is one by other settings
  if (!lit_) return updateStatus(true);  // they wait for a scene
  if (reshaped) {
    beginSolve();
    listeners_.tell([this](Listener& listener) { listener.onSceneLoaded(revision_); });
    (void)publishLightmaps(false);
    return;
  }
  if (anew) {
    lit_->invalidate();
    (void)fitsMemory([&] { lit_->restart(settings_); });
    return beginSolve();
  }
  callOffRefinement();  // it was for the settings before
  refined_times_ = 0;
  lit_->retarget(settings_);
  bool other_light = before.sky != settings_.sky;
  if (other_light && !takeInLight([&] { return other_light = lit_->setSky(settings_); })) other_light = true;
  if (other_light) {
    beginSolve();
    (void)publishLightmaps(false);
    return;
  }
  reconsiderStop();
  updateStatus(true);
}

void SolveLoop::reconsiderStop() {
  if (state_ != SolveState::kConverged && state_ != SolveState::kTimeLimit && state_ != SolveState::kLimited) return;
  // Where the program chooses texels, what is not measured counts as not reached: it will be.
  const auto& surface = lit_->surfaceError();
  // What has ended once though 95 % of places are further off could have no more.
  const auto aim = [&] {
    return state_ == SolveState::kConverged ? settings_.target_error : aimAtSurface(*surface, settings_.target_error);
  };
  const bool reached = settings_.choosesTexels() ? surface && surface->total <= aim()
                                                 : lit_->solver().error().total <= settings_.target_error;
  if (state_ == SolveState::kLimited && !reached && !settings_.choosesTexels()) return;
  failure_.clear();
  const SolveState now = reached         ? SolveState::kConverged
                         : isOutOfTime() ? SolveState::kTimeLimit
                                         : SolveState::kSolving;
  if (now == state_) return;
  if (now == SolveState::kSolving) {
    state_ = now;
  } else {
    endSolve(now);
  }
}

void SolveLoop::pause(Callback<SolveState> done) {
  askOf<SolveState>(Needs::kNoLoad, 0, std::move(done), [this]() -> Result<SolveState> {
    if (state_ == SolveState::kSolving) {
      state_ = SolveState::kPaused;
      if (unpublished_ && !fitsMemory([&] { publishLightmaps(false); })) unpublished_ = true;  // nothing else would
    }
    updateStatus(true);
    return state_;
  });
}

void SolveLoop::resume(Callback<SolveState> done) {
  askOf<SolveState>(Needs::kNoLoad, 0, std::move(done), [this]() -> Result<SolveState> {
    if (state_ == SolveState::kPaused) state_ = SolveState::kSolving;
    updateStatus(true);
    return state_;
  });
}

void SolveLoop::restart(Callback<SolveState> done) {
  askOf<SolveState>(Needs::kNoLoad, 0, std::move(done), [this]() -> Result<SolveState> {
    if (!lit_) return noScene();
    lit_->restart(settings_);
    state_ = SolveState::kSolving;
    beginSolve();
    return state_;
  });
}

}  // namespace radiosity::engine
