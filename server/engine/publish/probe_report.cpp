#include "server/engine/publish/probe_report.h"

#include <fmt/format.h>
#include <algorithm>
#include <glm/common.hpp>
#include <string>
#include <utility>

#include "common/task.h"
#include "server/engine/publish/stated_error.h"
#include "server/scene/document/json_text.h"
#include "server/scene/import/import_probes.h"
#include "server/solver/math/sampling.h"
#include "server/solver/surface/place_light.h"

namespace radiosity::engine {
namespace {

constexpr std::uint64_t kSeed = 0x50524f4245ULL;
/// Of the longest side of the scene's box: probes lie so far outside of it at most, and rays reach all of it.
constexpr double kMostBeyond = 1.0;
/// Of the spacing: where a side of the scene is shorter the scene is flat.
constexpr double kFlat = 0.25;
/// Probes of which values are told between interruption points.
constexpr std::size_t kProbesAtOnce = 4096;

struct Reach {
  glm::dvec3 low{0.0}, high{0.0};
};

/// World, metres.
Reach reachOf(const scene::PatchScene& patches) {
  glm::vec3 low = patches.vertices.front().position, high = low;
  for (const auto& vertex : patches.vertices) {
    low = glm::min(low, vertex.position);
    high = glm::max(high, vertex.position);
  }
  return {patches.centre + patches.scale * glm::dvec3(low), patches.centre + patches.scale * glm::dvec3(high)};
}

Reach reachOf(const scene::ProbeGrid& grid) {
  Reach box{grid.corner, grid.corner};
  for (const auto& side : grid.sides) {
    box.low += glm::min(side, glm::dvec3(0.0));
    box.high += glm::max(side, glm::dvec3(0.0));
  }
  return box;
}

std::string textOf(const glm::dvec3& at) { return fmt::format("({:.4g}, {:.4g}, {:.4g})", at.x, at.y, at.z); }

Result<void> requireInside(const scene::ProbeGrid& grid, const Reach& scene, double widest, const std::string& where) {
  const auto box = reachOf(grid);
  const auto reaches = fmt::format("the scene, which reaches from {} to {} m", textOf(scene.low), textOf(scene.high));
  if (glm::any(glm::lessThan(box.high, scene.low)) || glm::any(glm::greaterThan(box.low, scene.high)))
    return fail(ErrorCode::kInvalidScene, "lies outside of " + reaches, where);
  const glm::dvec3 beyond(kMostBeyond * widest);
  if (glm::any(glm::lessThan(box.low, scene.low - beyond)) || glm::any(glm::greaterThan(box.high, scene.high + beyond)))
    return fail(ErrorCode::kInvalidScene, "reaches farther beyond its walls than it is wide: " + reaches, where);
  return {};
}

/// Of a scene that is flat beside the spacing one layer would lie in its surfaces, or below half of them, and see
/// nothing: there are two then, half a spacing before and behind its middle.
scene::ProbeGrid wholeScene(const Reach& box, double spacing) {
  scene::ProbeGrid grid;
  grid.corner = box.low;
  for (int axis = 0; axis < 3; ++axis) {
    double side = box.high[axis] - box.low[axis];
    if (side < kFlat * spacing) {
      grid.corner[axis] += 0.5 * side - spacing;
      side = 2.0 * spacing;
    }
    grid.sides[static_cast<std::size_t>(axis)][axis] = side;
  }
  return grid;
}

Result<std::vector<scene::ProbeGrid>> gridsOf(const LitScene& lit, const ProbeRequest& request) {
  const auto& patches = lit.patches();
  if (patches.vertices.empty()) return fail(ErrorCode::kNotFound, "the scene has no surfaces");
  const auto box = reachOf(patches);
  if (request.spacing) {
    auto grid = wholeScene(box, *request.spacing);
    if (const auto ok = scene::divide(grid, *request.spacing, 0); !ok)
      return fail(ok.error().code, ok.error().message, "spacing");
    return std::vector{grid};
  }
  auto grids = scene::readProbeGrids(lit.document());
  if (!grids) return grids;
  if (grids->empty())
    return fail(ErrorCode::kNotFound,
                "the scene has no grid of probes: name a spacing, or give a node extras.radiosityProbes, such as "
                "{\"size\": [4, 3, 5], \"spacing\": 0.5}");
  for (const auto& grid : *grids) {
    const auto where =
        scene::place(lit.document().name, "/nodes/" + std::to_string(grid.node) + "/extras/radiosityProbes");
    if (const auto ok = requireInside(grid, box, patches.scale, where); !ok) return tl::unexpected(ok.error());
  }
  return grids;
}

solver::ProbeLattice latticeOf(const scene::ProbeGrid& grid, const scene::PatchScene& patches) {
  solver::ProbeLattice lattice;
  lattice.first = (grid.first() - patches.centre) / patches.scale;
  for (std::size_t axis = 0; axis < 3; ++axis) lattice.steps[axis] = grid.step(axis) / patches.scale;
  lattice.counts = grid.counts;
  return lattice;
}

ProbeGridLight placed(const scene::ProbeGrid& grid) {
  ProbeGridLight made;
  if (grid.node != scene::ProbeGrid::kWholeScene) made.node = grid.node;
  made.name = shortName(grid.name);
  made.counts = grid.counts;
  made.first = grid.first();
  for (std::size_t axis = 0; axis < 3; ++axis) made.steps[axis] = grid.step(axis);
  return made;
}

/// In the order that kProbeValues tells.
void addValues(const solver::ProbeLight& probe, const solver::ProbeSight& sight, double scale,
               std::vector<float>& values) {
  for (const auto* list : {&probe.light, &probe.error})
    for (const auto& of : *list) values.insert(values.end(), {of.x, of.y, of.z});
  const auto metres = static_cast<float>(scale);
  for (const float distance : sight.distance) values.push_back(metres * distance);
  for (const float square : sight.square) values.push_back(metres * metres * square);
  values.push_back(metres * sight.nearest);
  values.push_back(sight.backs);
  values.push_back(probe.ring == solver::ProbeLight::kUnfilled ? -1.0F : static_cast<float>(probe.ring));
}

}  // namespace

Result<ProbeParts> readProbes(const LitScene& lit, const ProbeRequest& request) {
  ProbeParts parts;
  auto grids = gridsOf(lit, request);
  if (!grids) return tl::unexpected<Error>(grids.error());
  parts.grids = std::move(*grids);
  if (!request.light) return parts;
  parts.patches = lit.sharedPatches();
  parts.materials = lit.materials();
  parts.sources = lit.sources();
  parts.seed = lit.settings().seed;
  parts.irradiance = lit.ownLight().mean;
  parts.systematic = systematicPart(lit, parts.irradiance);
  parts.difference = lit.solver().halfIrradiance(0);
  const auto second = lit.solver().halfIrradiance(1);
  for (std::size_t n = 0; n < second.size(); ++n) parts.difference[n] -= second[n];
  return parts;
}

void ProbeKeeper::clear() {
  kept_.clear();
  rays_.reset();
  sides_.reset();
  patches_.reset();
}

void ProbeKeeper::takeScene(const std::shared_ptr<const scene::PatchScene>& patches) {
  if (patches == patches_) return;
  clear();
  sides_ = std::make_unique<std::vector<solver::Side>>(solver::makeSides(*patches));
  rays_ = std::make_shared<const solver::LeafRays>(*patches, *sides_);
  patches_ = patches;  // last: the others may be interrupted
}

/// What nobody asks for now, or where rays go other ways by now, makes room for what is asked for.
void ProbeKeeper::dropOthers(const ProbeParts& parts, std::size_t in_all, const solver::PlaceLight& light) {
  std::erase_if(kept_, [&](const Kept& kept) {
    const bool is_wanted = kept.in_all == in_all && std::ranges::find(parts.grids, kept.grid) != parts.grids.end();
    return !is_wanted || !kept.set->fits(light);
  });
}

solver::ProbeSet& ProbeKeeper::setOf(const scene::ProbeGrid& grid, std::size_t in_all, const ProbeParts& parts,
                                     const solver::PlaceLight& light) {
  const auto same = std::ranges::find(kept_, grid, &Kept::grid);
  if (same != kept_.end()) return *same->set;
  const auto key = solver::mixKeys(solver::mixKeys(parts.seed, kSeed), grid.node);
  kept_.push_back({grid, in_all,
                   std::make_unique<solver::ProbeSet>(light, latticeOf(grid, *parts.patches),
                                                      solver::ProbeSet::raysFor(in_all), key, in_all)});
  return *kept_.back().set;
}

Result<std::vector<ProbeGridLight>> ProbeKeeper::lightOf(const ProbeParts& parts) {
  takeScene(parts.patches);
  const solver::PlaceLight light(
      {*parts.patches, rays_, nullptr, parts.materials, parts.sources, parts.irradiance, parts.difference});
  std::size_t in_all = 0;
  for (const auto& grid : parts.grids) in_all += grid.probeCount();
  if (parts.seed != seed_) kept_.clear();
  seed_ = parts.seed;
  dropOthers(parts, in_all, light);
  auto told = places(parts);
  for (std::size_t g = 0; g < parts.grids.size(); ++g) {
    auto& set = setOf(parts.grids[g], in_all, parts, light);
    if (!set.isWithinBounds())
      return fail(ErrorCode::kTooLarge,
                  fmt::format("mirrors send the rays of {} probes on too often: fewer probes, or a wider spacing, "
                              "would do",
                              in_all));
    const auto found = set.light(light, parts.systematic);
    told[g].values.reserve(found.size() * kProbeValues);
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (i % kProbesAtOnce == 0) interruptionPoint();
      addValues(found[i], set.sightOf(i), parts.patches->scale, told[g].values);
    }
  }
  return told;
}

Result<std::vector<ProbeGridLight>> ProbeKeeper::light(const ProbeParts& parts) {
  struct AtEnd {
    ProbeKeeper& keeper;
    ~AtEnd() { keeper.clearFormer(); }
  };
  const AtEnd at_end{*this};
  const std::scoped_lock lock(mutex_);
  return lightOf(parts);
}

void ProbeKeeper::letGo() {
  is_former_ = true;
  clearFormer();
}

/// Whoever holds the lock looks again once it is free: a flag that is raised meanwhile is not overlooked.
void ProbeKeeper::clearFormer() {
  while (is_former_) {
    const std::unique_lock lock(mutex_, std::try_to_lock);
    if (!lock) return;
    if (is_former_.exchange(false)) clear();
  }
}

std::vector<ProbeGridLight> ProbeKeeper::places(const ProbeParts& parts) {
  std::vector<ProbeGridLight> told;
  for (const auto& grid : parts.grids) told.push_back(placed(grid));
  return told;
}

}  // namespace radiosity::engine
