// Chooses which solver a scene gets. One thread.
#pragma once

#include <memory>

#include "server/scene/shading/shading_normals.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/solver.h"

namespace radiosity::solver {

/// With a former solver of the same settings: the links that the edit left alone stay, others are measured again with
/// the next steps. `normals`: that light is told for; it is carried by geometric ones, which error() is about. Where
/// links are forgotten it is told for these, too.
[[nodiscard]] std::unique_ptr<Solver> makeSolver(std::shared_ptr<const scene::PatchScene> patches,
                                                 const scene::PatchMaterials& materials, Transport& transport,
                                                 const SolverSettings& settings, const LightSources& sources = {},
                                                 const FormerSolver* former = nullptr,
                                                 std::shared_ptr<const scene::ShadingNormals> normals = nullptr);

}  // namespace radiosity::solver
