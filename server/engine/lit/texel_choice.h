// Where the program chooses texels: how many it begins with, how well light is to be known on them, and what others
// there should be. Pure functions of values; solve thread, but for texelBudget().
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "server/engine/engine.h"
#include "server/scene/charts/build.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/solver.h"
#include "server/solver/surface/surface_error.h"

namespace radiosity::engine {

/// LitScene::setDraft() of texels alike, which others are to replace.
inline constexpr double kPilotDraft = 0.06;

/// That a scene is laid out with first. Any thread.
[[nodiscard]] std::uint64_t texelBudget(const SolveSettings& settings);

/// What is stated at the surface is of both, the solver's error and that of texels: the solver's part. `draft_error`:
/// that texels leave which are to be replaced; 0: they are to stay. `closer`: of that, what was not enough.
[[nodiscard]] double solverTarget(const SolveSettings& settings, double draft_error, double closer);
/// It is never less: to be sure of an error that is nearly all texels' own takes for ever.
inline constexpr double kClosest = 0.25;

/// The total to reach at the surface: the target, or less where 95 % of places are not within kP95Times the target yet,
/// about what would bring these within it, if that is no less than kLeastAim of the target: of what is all but dark the
/// last places take for ever. Reached once `measured.total` is no more.
[[nodiscard]] double aimAtSurface(const solver::SurfaceErrorParts& measured, double target);
inline constexpr double kP95Times = 5.0, kLeastAim = 0.5;

struct WantedTexels {
  scene::TexelLayout layout;
  double error = 0.0;    ///< that is likely to be left by them alone
  double present = 0.0;  ///< likewise by those that there are
  double texels = 0.0;   ///< in all
};
/// For a total of `aim`, about; `patch_count`: that there are. Cost: some passes over the leaves.
[[nodiscard]] WantedTexels wantedTexels(const scene::PatchScene& patches, const solver::Solver& solver,
                                        std::span<const solver::SurfaceError::Measured> measured, double aim,
                                        std::uint64_t most_texels, std::uint64_t patch_count);

/// How many would be enough for it, about, however many there may be; nothing: those that there are cannot tell.
[[nodiscard]] std::optional<double> enoughTexels(const scene::PatchScene& patches, const solver::Solver& solver,
                                                 std::span<const solver::SurfaceError::Measured> measured, double aim);

}  // namespace radiosity::engine
