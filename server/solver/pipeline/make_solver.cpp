#include "server/solver/pipeline/make_solver.h"

#include "server/solver/paper/paper_solver.h"
#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/shooting/shooting_solver.h"

namespace radiosity::solver {
namespace {

/// Shooters a scene should at least be able to have.
constexpr std::size_t kMinShooters = 400;
/// Bytes of a leaf in a shooter's two columns: 16 bits each, and half of all leaves lie behind the shooter.
constexpr std::size_t kLeafBytes = 2;

}  // namespace

std::unique_ptr<Solver> makeSolver(std::shared_ptr<const scene::PatchScene> patches,
                                   const scene::PatchMaterials& materials, Transport& transport,
                                   const SolverSettings& settings, const LightSources& sources,
                                   const FormerSolver* former, std::shared_ptr<const scene::ShadingNormals> normals) {
  // Coverage by chance, pixel by pixel, makes links to what one can see through too uncertain to solve over: light
  // between sheets that all but touch would grow from bounce to bounce. Rays bring no more than there is.
  const bool see_through = !patches->opacity.empty();
  if (settings.method == Method::kPaper)
    return std::make_unique<PaperSolver>(std::move(patches), materials, transport, settings, sources);
  if (settings.method != Method::kGather ||
      (see_through && !LinkedSolver::mayGather(2 * patches->leaves.size(), settings)) ||
      patches->leaves.size() * kLeafBytes * kMinShooters > settings.link_memory) {
    return std::make_unique<ShootingSolver>(std::move(patches), materials, transport, settings, sources);
  }
  // What chance let through before an edit of geometry it may not let through again.
  auto* linked_before = former != nullptr && !see_through ? dynamic_cast<LinkedSolver*>(&former->solver) : nullptr;
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
