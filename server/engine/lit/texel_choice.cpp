#include "server/engine/lit/texel_choice.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "server/solver/surface/texel_detail.h"

namespace radiosity::engine {
namespace {

/// It looks at so many first, and at half of what there may be at most: enough to see where light bends.
constexpr std::uint64_t kPilotTexels = 16'000;
/// Of the error asked for so much may be the solver's and so much that of texels. Lookups have two thirds of the
/// solver's, since they average its noise over four texels. Where that is too much by chance the solve goes on
/// (solveCloser), and nothing is lost; texels that are too wide by chance take another layout.
constexpr double kSolversPart = 0.9, kTexelsPart = 0.72;
/// Of what texels leave that are to be replaced. With all of it, noise passed for shadows' edges in the small room,
/// which then took 400,000 texels in the place of 54,000.
constexpr double kDraftsPart = 0.6;
/// One layout has at most so many times as many texels as the one before, which tells too little of more.
constexpr double kMostGrowth = 8.0;
/// What is chosen for an error meets that up to rounding, unless texels would have to be finer than can be told.
constexpr double kMet = 1.001;

solver::TexelDetail chooseDetail(const scene::PatchScene& patches, const solver::Solver& solver,
                                 std::span<const solver::SurfaceError::Measured> measured,
                                 const solver::DetailGoal& goal) {
  const auto first = solver.halfIrradiance(0), second = solver.halfIrradiance(1), common = solver.commonErrorSquared();
  return solver::chooseDetail(patches, {first, second, common}, measured, goal);
}

}  // namespace

std::uint64_t texelBudget(const SolveSettings& settings) {
  return settings.choosesTexels() ? std::min((settings.texels + 1) / 2, kPilotTexels) : settings.texels;
}

double solverTarget(const SolveSettings& settings, double draft_error, double closer) {
  if (!settings.choosesTexels()) return settings.target_error;
  return std::max(kSolversPart * closer * settings.target_error, kDraftsPart * draft_error);
}

double aimAtSurface(const solver::SurfaceErrorParts& measured, double target) {
  const double most = kP95Times * target;
  if (measured.p95 <= most) return target;
  const double aim = std::min(target, measured.total * most / measured.p95);
  return aim >= kLeastAim * target ? aim : target;
}

WantedTexels wantedTexels(const scene::PatchScene& patches, const solver::Solver& solver,
                          std::span<const solver::SurfaceError::Measured> measured, double aim,
                          std::uint64_t most_texels, std::uint64_t patch_count) {
  const double most = std::min(static_cast<double>(most_texels), kMostGrowth * static_cast<double>(patch_count));
  auto wanted = chooseDetail(patches, solver, measured, {kTexelsPart * aim, most});
  return {{std::move(wanted.of_surface), patches.scale * patches.texel, patches.scale * patches.rough_texel},
          wanted.error,
          wanted.present,
          wanted.texels};
}

std::optional<double> enoughTexels(const scene::PatchScene& patches, const solver::Solver& solver,
                                   std::span<const solver::SurfaceError::Measured> measured, double aim) {
  const double target = kTexelsPart * aim;
  const auto wanted = chooseDetail(patches, solver, measured, {target, std::numeric_limits<double>::max()});
  return wanted.error <= kMet * target ? std::optional(wanted.texels) : std::nullopt;
}

}  // namespace radiosity::engine
