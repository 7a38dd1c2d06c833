// One scene and everything derived from it: document, values, patches, materials, solver. Belongs to the solve thread.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/engine/engine.h"
#include "server/engine/lit/leaf_light.h"
#include "server/engine/lit/light_report.h"
#include "server/engine/lit/scene_change.h"
#include "server/engine/lit/surface_probe.h"
#include "server/engine/lit/texel_choice.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/lightmap/lightmap.h"
#include "server/scene/lightmap/texel_fit.h"
#include "server/scene/shading/lit_sides.h"
#include "server/scene/values/lineage.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/pipeline/make_solver.h"
#include "server/solver/solver.h"

namespace radiosity::scene {
class BurialRecord;
struct BuiltScene;
}  // namespace radiosity::scene

namespace radiosity::engine {

/// What settings make of an imported scene: SolveSettings::double_sided.
void configureScene(scene::Scene& scene, const SolveSettings& settings);

class LitScene {
 public:
  /// Imports and charts. The transport stays as it is until upload(). `layout`: of its texels, as
  /// wantedTexels() tells; empty: all are alike.
  [[nodiscard]] static Result<std::unique_ptr<LitScene>> make(scene::Document document, const SolveSettings& settings,
                                                              solver::Transport& transport,
                                                              const scene::ImportLimits& limits = {},
                                                              scene::TexelLayout layout = {});
  /// The same for a document that has been imported already. With a former scene that this one is an edit of, charts
  /// that the edit left alone stay as they are.
  [[nodiscard]] static Result<std::unique_ptr<LitScene>> make(scene::EditedDocument edited,
                                                              const SolveSettings& settings,
                                                              solver::Transport& transport,
                                                              const LitScene* former = nullptr);

  /// As another process made it of this document, to restore() its solve: with these sides(), whatever its lamps were
  /// when it was laid out. kBadInput: the scene cannot have had them.
  [[nodiscard]] static Result<std::unique_ptr<LitScene>> makeAgain(
      scene::Document document, const SolveSettings& settings, solver::Transport& transport,
      const scene::SideBits& sides, scene::TexelLayout layout, const scene::ImportLimits& limits = {});

  /// Whether makeAgain() gives the same charts, so that a saved solve fits them. One whose charts stayed where a former
  /// scene had them is its own.
  [[nodiscard]] bool isReproducible() const { return reproducible_; }
  /// For makeAgain(). A pass over the surfaces.
  [[nodiscard]] scene::SideBits sides() const;
  /// Likewise: as it was made with.
  [[nodiscard]] const scene::TexelLayout& layout() const { return layout_; }

  /// Gives the geometry to the transport; must come before the solver's first step.
  [[nodiscard]] Result<void> upload() const { return transport_.setScene(patches_); }
  /// The same in two steps, between which renderers take it in by themselves.
  [[nodiscard]] Result<void> beginUpload() {
    return transport_.beginScene(patches_, std::exchange(prepared_, nullptr));
  }
  /// Makes beforehand, on any thread, most of what beginUpload() does. Where that fails beginUpload() will, too.
  void prepareUpload();
  [[nodiscard]] Result<void> finishUpload() const { return transport_.finishScene(); }

  /// `next`: after configureScene(). What switches a lamp that lies on another face, or under one, changes geometry:
  /// another of them is seen then. So does light that reaches sides which had none, and so no texels: they get some.
  [[nodiscard]] SceneChange changeTo(const scene::Scene& next) const;
  /// Whether the sky of these settings reaches sides that had no light, and so no texels: then setSky() is not enough.
  [[nodiscard]] bool outgrows(const SolveSettings& settings) const;

  /// Whether pages and UVs are those of `former`, and who has its GLB needs no other: tiles stay valid.
  [[nodiscard]] bool keepsLayoutOf(const LitScene& former) const;

  /// Finds what stays of `former`, of which this scene is an edit, and says what the edit touches: these surfaces, and
  /// at most so many shots.
  struct Affected {
    std::uint64_t surfaces = 0, shots = 0;
  };
  [[nodiscard]] Affected succeed(const LitScene& former);
  /// Surfaces that differ between `former` and this scene, one of which is an edit of the other.
  [[nodiscard]] std::uint64_t surfacesTouchedSince(const LitScene& former) const;
  /// Prepares the solve, whose first step must come after upload(); of what is prepared already, without a former,
  /// nothing is done. What stays of the links of `former`, after succeed(), is taken from it: its solver is of no use
  /// afterwards, unless it is to be kept, which takes the memory of both. Returns the shots that are to be taken again.
  /// May be called again where it threw and the former is whole.
  std::uint64_t startSolve(LitScene* former = nullptr, bool keep_former = false);

  /// startSolve() without a former, and the ray tree that its first steps would make: a third of a second for 100,000
  /// triangles, in which no edit is heard. Any thread.
  void prepareSolve() {
    (void)startSolve();
    if (settings_.method == Method::kGather && settings_.link_memory_bytes > 0) (void)solver_->rays();
  }

  /// Surfaces that a change to `next` would touch; all of them where it changes geometry or lights.
  [[nodiscard]] std::uint64_t affectedBy(const SceneChange& change, const scene::Scene& next) const;

  /// Takes over what leaves the geometry as it is. Where memory runs out in it the scene is the edited one, and
  /// stale. Returns the document before: to destroy it takes a hundredth of the time that a small edit does.
  std::shared_ptr<const scene::Document> reshade(scene::Document document, std::shared_ptr<const scene::Scene> next,
                                                 const SceneChange& change);

  /// Shows `before`'s light, on the charts that are still there, until this scene's own is as good. `same_layout`: of
  /// keepsLayoutOf(before); then all of it stays as it is.
  void fadeFrom(LitScene& before, bool same_layout);

  [[nodiscard]] const scene::Document& document() const { return *document_; }
  [[nodiscard]] const scene::Scene& scene() const { return *scene_; }
  [[nodiscard]] const scene::PatchScene& patches() const { return *patches_; }
  // The same for another thread, which may keep them after the next edit.
  [[nodiscard]] const std::shared_ptr<const scene::Document>& sharedDocument() const { return document_; }
  [[nodiscard]] const std::shared_ptr<const scene::Scene>& sharedScene() const { return scene_; }
  [[nodiscard]] const std::shared_ptr<const scene::PatchScene>& sharedPatches() const { return patches_; }
  [[nodiscard]] const scene::PatchMaterials& materials() const { return materials_; }
  [[nodiscard]] const solver::LightSources& sources() const { return sources_; }
  [[nodiscard]] solver::Solver& solver() { return *solver_; }
  [[nodiscard]] const solver::Solver& solver() const { return *solver_; }
  [[nodiscard]] const SolveSettings& settings() const { return settings_; }
  /// The scene's own, or else that of the settings; black: none.
  [[nodiscard]] scene::Sky sky() const { return skyOf(*scene_); }
  /// What is odd about the scene; the first so many.
  [[nodiscard]] std::vector<std::string> warnings(std::size_t most = std::numeric_limits<std::size_t>::max()) const;
  [[nodiscard]] std::size_t warningCount() const;
  /// Leaf patches with area.
  [[nodiscard]] std::uint64_t patchCount() const { return patch_count_; }

  /// The solve so far, as Solver::save() and restore().
  [[nodiscard]] bool save(ArchiveWriter& to) const;
  [[nodiscard]] bool restore(ArchiveReader& from);

  /// Starts the solve over, with other settings that leave the charts as they are.
  void restart(const SolveSettings& settings);
  /// The solve is none of this scene, or of these settings: it must not go on before restart().
  void invalidate() { stale_ = true; }
  [[nodiscard]] bool isStale() const { return stale_; }

  /// Another target or time limit: the solve goes on from where it is.
  void retarget(const SolveSettings& settings) {
    if (settings.target_error != settings_.target_error) closer_ = 1.0;
    settings_ = settings;
    solver_->setTargetError(solverTarget(settings_, draft_error_, closer_));
  }

  /// Finds out where light is lost, once a solve has come to its end: warnings() names it. Costs nothing where little
  /// is.
  void reportLight();
  [[nodiscard]] const std::vector<std::string>& lostLight() const { return light_report_.lost(); }
  /// As Status::unlit.
  [[nodiscard]] std::string unlit(const solver::EnergyParts& energy) const;

  /// Another sky for scenes that have none of their own. True: it changes the light.
  bool setSky(const SolveSettings& settings);

  /// The solver's present irradiance by node, lux, nowhere below 0.
  [[nodiscard]] scene::LeafLight ownLight() const;
  /// The same as lightmaps are to hold it: of translucent surfaces with what glows through (translucent_texels.h).
  [[nodiscard]] scene::LeafLight shownLight() const { return showThrough(ownLight(), *patches_, materials_); }
  /// Finished pages of it (filled, stitched, dilated).
  [[nodiscard]] std::vector<scene::LightmapPage> pages() const;
  /// What viewers see: after an edit the light that was there before fades into pages() as these become as good.
  [[nodiscard]] std::vector<scene::LightmapPage> shownPages();
  /// Nothing of the light before an edit is in what is shown.
  [[nodiscard]] bool showsOwnLight() const { return old_light_.empty() && !former_light_; }
  /// The light that the solver had before an edit is to be shown still, and lies where it lay.
  [[nodiscard]] bool showsFormerLight() const {
    return former_light_ && former_light_->same_layout && !former_light_->has_pages;
  }
  /// From here on the solver's own light is shown, as good as it is.
  void endFade() {
    old_error_ = 1.0;
    former_light_.reset();
    old_light_.clear();
    old_direct_.clear();
    until_settled_ = false;
  }
  /// From how many bytes of links and rays on an edit shows the lights' own part first: the light over fewer is solved
  /// for sooner than anyone sees that it is late.
  void setSlowLinks(std::size_t bytes) { slow_links_ = bytes; }
  /// While an edit of geometry is being solved, as soon as the lights' own part of the new light is known: shows it in
  /// the place of their old one, so that shadows move long before reflected light follows. True: what viewers see has
  /// changed. Once for each edit; costs two passes over the pages.
  [[nodiscard]] bool showDirectLight();

  /// Goes on for about `seconds` with measuring what surfaceError() tells of the light that there is; `is_late`: no
  /// longer than it must.
  void probeSurface(double seconds, bool is_late);
  /// The light has been solved further.
  void forgetSurface() { surface_probe_.forget(); }
  /// There is no memory to measure it with: not before the light has changed.
  void giveUpSurface() { surface_probe_.giveUp(); }
  [[nodiscard]] bool lacksSurface() const { return surface_probe_.isLacking(); }
  /// Nothing: it is not measured.
  [[nodiscard]] const std::optional<solver::SurfaceErrorParts>& surfaceError() const { return surface_probe_.stated(); }
  /// ErrorEstimate::total, of what viewers see.
  [[nodiscard]] double shownError() const;
  /// After fadeFrom(): what is shown until this scene's own light is as good is the light of the same scene on coarser
  /// texels, with such an error at the surface.
  void setOldError(double error) { old_error_ = error; }
  /// Where the program chooses texels: these are not enough, and tell where others are to be finer. Before
  /// startSolve(). `error`: that is likely to be left by texels; light need not be known much better. 0: they are to
  /// stay.
  void setDraft(double error) { draft_error_ = error; }
  [[nodiscard]] double draftError() const { return draft_error_; }
  [[nodiscard]] bool isDraft() const { return draft_error_ > 0.0; }
  /// These texels are fine enough, and light on them is not known well enough: the solve goes on from where it is.
  /// False: it is at that already. `share`: of what the solver leaves now, what it may leave.
  [[nodiscard]] bool solveCloser(double share) {
    if (closer_ <= kClosest) return false;
    const double now = solver_->error().total / solverTarget(settings_, draft_error_, 1.0);
    closer_ = std::max(kClosest, std::min(closer_, now) * share);
    solver_->setTargetError(solverTarget(settings_, draft_error_, closer_));
    return true;
  }
  /// All such shares together; before startSolve().
  void setCloser(double share) { closer_ = share; }
  [[nodiscard]] double closer() const { return closer_; }
  /// Once surfaceError() is there: what texels there should be for such a total, about.
  [[nodiscard]] WantedTexels wantedTexels(double aim) const;
  /// Likewise: how many there would have to be, be that more than there may be. Nothing: that cannot be told.
  [[nodiscard]] std::optional<double> enoughTexels(double aim) const;

 private:
  [[nodiscard]] static Result<std::unique_ptr<LitScene>> build(scene::EditedDocument edited,
                                                               const SolveSettings& settings,
                                                               solver::Transport& transport, const LitScene* former,
                                                               scene::TexelLayout layout);
  LitScene(scene::EditedDocument edited, const SolveSettings& settings, solver::Transport& transport)
      : document_(std::make_shared<const scene::Document>(std::move(edited.document))),
        settings_(settings),
        transport_(transport),
        scene_(std::make_shared<const scene::Scene>(std::move(edited.scene))) {}
  /// Light before an edit, by node, and the scene that had it: most edits are solved before anyone looks at it.
  struct FormerLight {
    std::shared_ptr<const scene::Scene> scene;
    std::shared_ptr<const scene::PatchScene> patches;
    bool same_layout;
    scene::LeafLight all;
    std::vector<glm::vec3> direct;  ///< lux; empty: not known
    bool has_pages = false;         ///< `all` is in old_light_, and given back

    [[nodiscard]] std::vector<scene::LightmapPage> pages(const std::vector<glm::vec3>& texels,
                                                         const LitScene& to) const;
  };
  [[nodiscard]] bool hasNoLamp() const {
    return power_ <= 0.0 && !patches_->surfaces.empty() && light_report_.dark().empty();
  }
  [[nodiscard]] LitParts litParts() const;
  void makeSolver(const solver::FormerSolver* former = nullptr);
  void updateSolver(bool materials, bool lights);
  [[nodiscard]] std::vector<scene::LightmapPage> pagesOfNow();
  void makeOldPages();
  void makeOldDirectPages();
  void forgetOldDirect();
  void showLightsFirst(const std::vector<glm::vec3>& direct_before);
  [[nodiscard]] std::vector<scene::LightmapPage> directPages() const;
  /// Of shownLight() the part that comes straight from lights; empty: not known.
  [[nodiscard]] std::vector<glm::vec3> directLight() const {
    return showThrough({solver_->directIrradiance()}, *patches_, materials_).mean;
  }
  [[nodiscard]] std::optional<scene::PatchMap> mapFrom(const LitScene& former) const;
  [[nodiscard]] std::uint64_t touchedSurfaces(std::size_t before, const std::optional<scene::PatchMap>& matched) const;
  [[nodiscard]] double emittedPower() const;
  [[nodiscard]] scene::Sky skyOf(const scene::Scene& scene) const;
  [[nodiscard]] solver::LightSources lightSources(const scene::Scene& scene) const;
  [[nodiscard]] bool reachesDarkSides(const scene::Scene& next, const scene::Sky& sky) const;
  [[nodiscard]] scene::ChartOptions chartOptions() const;
  void setLayout(scene::TexelLayout layout);
  /// What was built of scene_.
  void take(scene::BuiltScene built);

  std::shared_ptr<const scene::Document> document_;
  SolveSettings settings_;
  solver::Transport& transport_;
  std::shared_ptr<const scene::Scene> scene_;
  std::shared_ptr<const scene::PatchScene> patches_;
  std::unique_ptr<solver::Transport::Prepared> prepared_;  // of these; null: that is not done, or is used
  std::shared_ptr<const scene::ShadingNormals> normals_;
  std::shared_ptr<const scene::BurialRecord> burial_;  // of these, for edits; null: not kept
  /// Of these, once an edit of light asked for it: the next ones do.
  mutable std::shared_ptr<const geometry::RayScene> tree_;
  std::uint64_t patch_count_ = 0;
  scene::PatchMaterials materials_;
  LightReport light_report_;
  SurfaceProbe surface_probe_;
  bool stale_ = false;
  bool reproducible_ = true;
  scene::TexelLayout layout_;
  double draft_error_ = 0.0;                   // setDraft()
  double closer_ = 1.0;                        // setCloser()
  std::optional<scene::PatchMap> former_map_;  // from succeed() to startSolve()
  std::unique_ptr<solver::Solver> solver_;
  solver::LightSources sources_;                 // that the solver knows of
  double power_ = 0.0;                           // emitted, all channels
  double solver_power_ = 0.0;                    // emitted power the solver's flux scale was chosen for
  std::optional<FormerLight> former_light_;      // of which the next two, or the second, are to be made
  std::vector<scene::LightmapPage> old_light_;   // what was shown before an edit; empty: no fade
  std::vector<scene::LightmapPage> old_direct_;  // of it, what came straight from lights; empty: not known, or replaced
  double new_share_ = 0.0;                       // of the solver's own light in what is shown; never falls
  double old_error_ = 1.0;                       // of the light of coarser texels, which is shown until then
  std::size_t slow_links_ = std::size_t{64} << 20;
  bool until_settled_ = false;  // old_light_ has the lights' new part, and stands in for that long
};

}  // namespace radiosity::engine
