// LinkedSolver after an edit of geometry: what it takes over from the solver of the scene before.
#include <algorithm>
#include <optional>
#include <span>
#include <utility>

#include "common/parallel.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {

LinkedSolver::LinkedSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
                           Transport& transport, const SolverSettings& settings, const LightSources& sources,
                           LinkedSolver& former, const scene::PatchMap& map, bool keep_former)
    : LinkedSolver(std::move(patches), transport, settings) {
  LinkInheritance links({former.parts_, former.repair_, former.key_ends_, keep_former},
                        {parts_, repair_, sides_, lights_}, map);
  key_ends_ = links.keys();
  const auto reach = prepareRepair(former, links, map);
  takeCounts(former);
  aim_ = std::max(former.aim_, settings_.target_error);
  planner_.setTarget(aim_);
  planner_.inherit(former.planner_, links.sideAfter());
  links.takeLights();
  takeMaterials(materials);
  takeSources(sources);
  links.takeNodes();
  links.takeEntries();
  repair_.plan(former.isRepairing() ? 0.0 : former.fieldNorm(),
               former.phase_ == Phase::kDone ? former.errorBesideMissing() : settings_.target_error, reach);
  const auto value_before = links.unalteredBefore();
  if (former.variation_.isTraced()) inheritVariation(former, value_before);
  if (former.gather_) inheritRays(former, value_before);
  for (auto& half : half_) half.assign(system_.leafAreas().size(), glm::vec3(0.0F));
  findUnshot();
  solveAnew();
}

/// What the edit changed, and how far that reaches: each is made by a thread of its own.
ChangeReach LinkedSolver::prepareRepair(const LinkedSolver& former, const LinkInheritance& links,
                                        const scene::PatchMap& map) {
  auto change = links.change();
  if (former.repair_.lacksLinks()) {
    auto all = change;
    links.addEarlier(all);
    repair_.shadows().earlier = std::make_unique<Shadows>(*patches_, sides_, std::move(all));
  }
  std::optional<ChangeReach> reach;
  const auto prepare = [&](std::size_t part) {  // each reads what none of them writes
    if (part == 0) repair_.shadows().now = std::make_unique<Shadows>(*patches_, sides_, std::move(change));
    if (part == 1) reach.emplace(*former.patches_, *patches_, map);
    if (part == 2 && (former.variation_.isTraced() || former.gather_)) (void)leafRays();
  };
  inTurns(3, prepare);
  return std::move(*reach);
}

/// Counters go on from those of the solver before.
void LinkedSolver::takeCounts(const LinkedSolver& former) {
  repair_.countFrom(former.repair_);
  counters_ = former.counters_;
  rounds_ = former.rounds_;
  solutions_ = former.solutions_;
  sweeps_ = former.sweeps_;
  replayed_ = former.replayed_;
}

void LinkedSolver::inheritVariation(const LinkedSolver& former, std::span<const std::uint32_t> value_before) {
  // Lamps that moved come after those that did not.
  const bool same_lights = std::ranges::equal(former.lights_, lights_, [](const auto& a, const auto& b) {
    return a.key == b.key && a.corners == b.corners && a.corner_count == b.corner_count;
  });
  variation_.inherit(former.variation_, value_before, *repair_.shadows().now, same_lights, lights_);
}

}  // namespace radiosity::solver
