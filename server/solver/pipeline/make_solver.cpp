#include "server/solver/pipeline/make_solver.h"

#include "server/solver/paper/paper_solver.h"
#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/shooting/shooting_solver.h"

namespace radiosity::solver {

std::unique_ptr<Solver> makeSolver(std::shared_ptr<const scene::PatchScene> patches,
                                   const scene::PatchMaterials& materials, Transport& transport,
                                   const SolverSettings& settings, const LightSources& sources,
                                   const FormerSolver* former, std::shared_ptr<const scene::ShadingNormals> normals) {
  const bool see_through = !patches->opacity.empty();
  if (settings.method == Method::kPaper)
    return std::make_unique<PaperSolver>(std::move(patches), materials, transport, settings, sources);
  if (settings.method != Method::kGather || !LinkedSolver::mayGather(*patches, settings))
    return std::make_unique<ShootingSolver>(std::move(patches), materials, transport, settings, sources);
  // What chance let through before an edit of geometry it may not let through again.
  auto* linked_before = former != nullptr && !see_through ? dynamic_cast<LinkedSolver*>(&former->solver) : nullptr;
  // Rays that went through coloured glass know which leaves of it, and there is none any more.
  if (linked_before != nullptr && linked_before->hasTints()) linked_before = nullptr;
  std::unique_ptr<LinkedSolver> linked;
  if (linked_before != nullptr) {
    linked = std::make_unique<LinkedSolver>(patches, materials, transport, settings, sources, *linked_before,
                                            former->map, former->keep);
  } else {
    linked = std::make_unique<LinkedSolver>(patches, materials, transport, settings, sources);
  }
  linked->shadeFor(std::move(normals));
  if (linked->lightBytes() <= settings.link_memory / 2) return linked;
  return std::make_unique<ShootingSolver>(std::move(patches), materials, transport, settings, sources);
}

}  // namespace radiosity::solver
