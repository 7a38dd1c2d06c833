#include "server/engine/publish/probe_report.h"

#include <fmt/format.h>
#include <algorithm>
#include <glm/common.hpp>
#include <string>
#include <utility>

#include "common/task.h"
#include "server/scene/document/json_text.h"
#include "server/scene/import/import_probes.h"
#include "server/solver/math/sampling.h"
#include "server/solver/surface/place_light.h"

namespace radiosity::engine {
namespace {

constexpr std::uint64_t kSeed = 0x50524f4245ULL;
/// Of the longest side of the scene's box: probes lie so far outside of it at most, and rays reach all of it.
constexpr double kMostBeyond = 1.0;
/// Probes of which values are told between interruption points.
constexpr std::size_t kProbesAtOnce = 4096;

struct Box {
  glm::dvec3 low{0.0}, high{0.0};
};

/// World, metres.
Box boxOf(const scene::PatchScene& patches) {
  glm::vec3 low = patches.vertices.front().position, high = low;
  for (const auto& vertex : patches.vertices) {
    low = glm::min(low, vertex.position);
    high = glm::max(high, vertex.position);
  }
  return {patches.centre + patches.scale * glm::dvec3(low), patches.centre + patches.scale * glm::dvec3(high)};
}

Box boxOf(const scene::ProbeGrid& grid) {
  Box box{grid.corner, grid.corner};
  for (const auto& side : grid.sides) {
    box.low += glm::min(side, glm::dvec3(0.0));
    box.high += glm::max(side, glm::dvec3(0.0));
  }
  return box;
}

std::string textOf(const glm::dvec3& at) { return fmt::format("({:.4g}, {:.4g}, {:.4g})", at.x, at.y, at.z); }

Result<void> requireInside(const scene::ProbeGrid& grid, const Box& scene, double widest, const std::string& where) {
  const auto box = boxOf(grid);
  const auto reaches = fmt::format("the scene, which reaches from {} to {} m", textOf(scene.low), textOf(scene.high));
  if (glm::any(glm::lessThan(box.high, scene.low)) || glm::any(glm::greaterThan(box.low, scene.high)))
    return fail(ErrorCode::kInvalidScene, "lies outside of " + reaches, where);
  const glm::dvec3 beyond(kMostBeyond * widest);
  if (glm::any(glm::lessThan(box.low, scene.low - beyond)) || glm::any(glm::greaterThan(box.high, scene.high + beyond)))
    return fail(ErrorCode::kInvalidScene, "reaches farther beyond its walls than it is wide: " + reaches, where);
  return {};
}

Result<std::vector<scene::ProbeGrid>> gridsOf(const LitScene& lit, const ProbeRequest& request) {
  const auto& patches = lit.patches();
  if (patches.vertices.empty()) return fail(ErrorCode::kNotFound, "the scene has no surfaces");
  const auto box = boxOf(patches);
  if (request.spacing) {
    scene::ProbeGrid grid;
    grid.corner = box.low;
    for (int axis = 0; axis < 3; ++axis)
      grid.sides[static_cast<std::size_t>(axis)][axis] = box.high[axis] - box.low[axis];
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
  made.name = grid.name;
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
  parts.difference = lit.solver().halfIrradiance(0);
  const auto second = lit.solver().halfIrradiance(1);
  for (std::size_t n = 0; n < second.size(); ++n) parts.difference[n] -= second[n];
  return parts;
}

void ProbeKeeper::takeScene(const std::shared_ptr<const scene::PatchScene>& patches) {
  if (patches == patches_) return;
  kept_.clear();
  rays_.reset();
  patches_ = patches;
  sides_ = std::make_unique<std::vector<solver::Side>>(solver::makeSides(*patches));
  rays_ = std::make_shared<const solver::LeafRays>(*patches_, *sides_);
}

/// What is kept of this grid, as long as rays still go as it remembers; else it is made anew.
ProbeKeeper::Kept ProbeKeeper::take(const Kept& wanted, const solver::PlaceLight& light,
                                    const scene::PatchScene& patches) {
  const auto same = std::ranges::find_if(kept_, [&](const Kept& kept) {
    return kept.set && kept.grid == wanted.grid && kept.rays == wanted.rays && kept.key == wanted.key;
  });
  if (same != kept_.end() && same->set->fits(light)) return std::move(*same);
  return {wanted.grid, wanted.rays, wanted.key,
          std::make_unique<solver::ProbeSet>(light, latticeOf(wanted.grid, patches), wanted.rays, wanted.key)};
}

std::vector<ProbeGridLight> ProbeKeeper::light(const ProbeParts& parts) {
  takeScene(parts.patches);
  const solver::PlaceLight light(
      {*parts.patches, rays_, nullptr, parts.materials, parts.sources, parts.irradiance, parts.difference});
  std::size_t probes = 0;
  for (const auto& grid : parts.grids) probes += grid.probeCount();
  auto told = places(parts);
  std::vector<Kept> next;
  for (std::size_t g = 0; g < parts.grids.size(); ++g) {
    const auto key = solver::mixKeys(solver::mixKeys(parts.seed, kSeed), parts.grids[g].node);
    next.push_back(take({parts.grids[g], solver::ProbeSet::raysFor(probes), key, nullptr}, light, *parts.patches));
    auto& set = *next.back().set;
    const auto found = set.light(light);
    told[g].values.reserve(found.size() * kProbeValues);
    for (std::size_t i = 0; i < found.size(); ++i) {
      if (i % kProbesAtOnce == 0) interruptionPoint();
      addValues(found[i], set.sightOf(i), parts.patches->scale, told[g].values);
    }
  }
  kept_ = std::move(next);
  return told;
}

std::vector<ProbeGridLight> ProbeKeeper::places(const ProbeParts& parts) {
  std::vector<ProbeGridLight> told;
  for (const auto& grid : parts.grids) told.push_back(placed(grid));
  return told;
}

}  // namespace radiosity::engine
