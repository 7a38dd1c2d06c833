// The light that a solver has now, as lightmaps want it. Solve thread.
#pragma once

#include "server/engine/engine.h"
#include "server/scene/lightmap/texel_fit.h"
#include "server/solver/solver.h"

namespace radiosity::engine {

/// Noise leaves single leaves a little darker than black. Nothing is: cutting it off only takes error away. Cost: three
/// passes over the leaves.
[[nodiscard]] scene::LeafLight leafLight(const solver::Solver& solver, const SolveSettings& settings);

/// As lightmaps are to hold it: of translucent surfaces with what glows through (translucent_texels.h).
[[nodiscard]] scene::LeafLight showThrough(scene::LeafLight light, const scene::PatchScene& patches,
                                           const scene::PatchMaterials& materials);

}  // namespace radiosity::engine
