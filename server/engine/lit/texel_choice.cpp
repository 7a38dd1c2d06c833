#include "server/engine/lit/texel_choice.h"

#include <algorithm>
#include <utility>

#include "server/solver/surface/texel_detail.h"

namespace radiosity::engine {
namespace {

/// It looks at so many first, and at half of what there may be at most: enough to see where light bends.
constexpr std::uint64_t kPilotTexels = 16'000;
/// Of the error asked for, whose square is that of both, so much may be the solver's and so much that of texels. Texels
/// cost more than samples: in a room of chairs halving their error takes four times as many.
constexpr double kSolversPart = 0.5, kTexelsPart = 0.82;
/// One layout has at most so many times as many texels as the one before, which tells too little of more.
constexpr double kMostGrowth = 8.0;

}  // namespace

std::uint64_t texelBudget(const SolveSettings& settings) {
  return settings.choosesTexels() ? std::min((settings.texels + 1) / 2, kPilotTexels) : settings.texels;
}

double solverTarget(const SolveSettings& settings, double draft_error) {
  return settings.choosesTexels() ? kSolversPart * std::max(settings.target_error, draft_error) : settings.target_error;
}

WantedTexels wantedTexels(const scene::PatchScene& patches, const solver::Solver& solver,
                          std::span<const solver::SurfaceError::Measured> measured, const SolveSettings& settings,
                          std::uint64_t patch_count) {
  const double most = std::min(static_cast<double>(settings.texels), kMostGrowth * static_cast<double>(patch_count));
  auto wanted = solver::chooseDetail(patches, solver.halfIrradiance(0), solver.halfIrradiance(1), measured,
                                     {kTexelsPart * settings.target_error, most});
  return {{std::move(wanted.of_surface), patches.scale * patches.texel, patches.scale * patches.rough_texel},
          wanted.error,
          wanted.texels};
}

}  // namespace radiosity::engine
