// One scene and everything derived from it: document, values, patches, materials, solver. Belongs to the solve thread.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/engine/engine.h"
#include "server/scene/document.h"
#include "server/scene/lightmap.h"
#include "server/scene/patch_scene.h"
#include "server/solver/solver.h"

namespace radiosity::engine {

class LitScene {
 public:
  /// Imports, charts and prepares a solve. The transport stays as it is until upload().
  [[nodiscard]] static Result<std::unique_ptr<LitScene>> make(scene::Document document, const SolveSettings& settings,
                                                              solver::Transport& transport);

  /// Gives the geometry to the transport; must come before the solver's first step.
  [[nodiscard]] Result<void> upload() const { return transport_.setScene(patches_); }

  /// What a patch would do. kShading: emission and reflectance of surfaces; kNothing: no surface (names, extras,
  /// cameras, and lights and the sky, which reshade() looks at itself); else kGeometry.
  enum class Change { kNothing, kShading, kGeometry };
  [[nodiscard]] Change changeTo(const scene::Document& next) const;

  /// Takes over a document that differs by kNothing or kShading. Returns the number of surfaces affected. Nothing
  /// changes on error.
  [[nodiscard]] Result<std::uint64_t> reshade(scene::Document next, Change change);

  [[nodiscard]] const scene::Document& document() const { return document_; }
  [[nodiscard]] const scene::Scene& scene() const { return *scene_; }
  [[nodiscard]] const scene::PatchScene& patches() const { return *patches_; }
  [[nodiscard]] const scene::PatchMaterials& materials() const { return materials_; }
  [[nodiscard]] solver::Solver& solver() { return *solver_; }
  [[nodiscard]] const solver::Solver& solver() const { return *solver_; }
  [[nodiscard]] const SolveSettings& settings() const { return settings_; }
  [[nodiscard]] std::vector<std::string> warnings() const;

  /// Starts the solve over, with other settings that leave the charts as they are.
  void restart(const SolveSettings& settings);

  /// Another target or time limit: the solve goes on from where it is.
  void retarget(const SolveSettings& settings) {
    settings_ = settings;
    solver_->setTargetError(settings.target_error);
  }

  /// Another sky for scenes that have none of their own. True: it changes the light.
  bool setSky(const SolveSettings& settings);

  /// Finished pages of the solver's present irradiance (filled, stitched, dilated).
  [[nodiscard]] std::vector<scene::LightmapPage> pages() const;
  /// The same of the estimated sampling error, relative to the irradiance.
  [[nodiscard]] std::vector<scene::LightmapPage> errorPages() const;

 private:
  LitScene(scene::Document document, const SolveSettings& settings, solver::Transport& transport)
      : document_(std::move(document)), settings_(settings), transport_(transport) {}
  void makeSolver();
  void updateSolver(bool materials, bool lights);
  [[nodiscard]] double emittedPower() const;
  [[nodiscard]] solver::LightSources lightSources() const;

  scene::Document document_;
  SolveSettings settings_;
  solver::Transport& transport_;
  std::shared_ptr<const scene::Scene> scene_;
  std::shared_ptr<const scene::PatchScene> patches_;
  scene::PatchMaterials materials_;
  std::unique_ptr<solver::Solver> solver_;
  solver::LightSources sources_;  // that the solver knows of
  double power_ = 0.0;            // emitted, all channels
  double solver_power_ = 0.0;     // emitted power the solver's flux scale was chosen for
};

}  // namespace radiosity::engine
