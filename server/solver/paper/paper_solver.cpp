#include "server/solver/paper/paper_solver.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/solver/math/sampling.h"
#include "server/solver/patches/unshot_pyramid.h"
#include "server/solver/transport/node_shots.h"

namespace radiosity::solver {
namespace {

constexpr std::uint32_t kKind = 0x32504150U;  // "PAP2": what a checkpoint holds

/// "We used a LOD bias of one, with filtering by a 3 by 3 Gaussian filter" (section 5).
constexpr float kLevelBias = 1.0F;
/// Power of a shot, as a part of all that is emitted: a patch is descended from where one of its children has more. The
/// paper names none, and counts on "more finely subdivided shooting patches" against artifacts (section 4.3). Of the
/// light of the small room 24 % is off with a 256th and 14 % with a 1024th, which takes two and a half times as long.
constexpr double kShotsOfAll = 1024.0;
/// Residual before the first light, and at most: above all that may be asked for.
constexpr double kNothingArrived = 2.0;
/// Pixels of a hemicube's top face: of the weakest shots and of the strongest. The paper names none.
constexpr std::uint32_t kLeastResolution = 32, kMostResolution = 256;

glm::dvec3 emittedBy(const ShotBatch& batch) {
  glm::dvec3 sum(0.0);
  for (const auto& shot : batch.point_lights) sum += glm::dvec3(shot.emitted[0], shot.emitted[1], shot.emitted[2]);
  for (const auto& shot : batch.parallel) sum += glm::dvec3(shot.emitted[0], shot.emitted[1], shot.emitted[2]);
  for (const auto& shot : batch.lamps) sum += glm::dvec3(shot.emitted[0], shot.emitted[1], shot.emitted[2]);
  return sum;
}

PunctualLights lightsOf(const scene::PatchScene& patches, const LightSources& sources, std::uint64_t seed) {
  PunctualSettings settings;
  settings.seed = seed;
  settings.rays_see_sky = false;
  return {patches, sources, settings};
}

}  // namespace

PaperSolver::PaperSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
                         Transport& transport, const SolverSettings& settings, const LightSources& sources)
    : patches_(std::move(patches)),
      materials_(materials),
      transport_(transport),
      settings_(settings),
      sources_(sources),
      punctual_(lightsOf(*patches_, sources_, settings_.seed)),
      trees_(patches_, materials_, punctual_.owed(1)) {
  startAnew();
}

void PaperSolver::startAnew() {
  punctual_ = lightsOf(*patches_, sources_, settings_.seed);
  trees_ = PatchTrees(patches_, materials_, punctual_.owed(1));
  emitted_ = glm::dvec3(0.0);
  for (const auto& side : trees_.sides())
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      emitted_ +=
          static_cast<double>(patches_->node_area[side.first_node + leaf]) * glm::dvec3(trees_.emission(side, leaf));
  shown_.reset();
  received_ = reflected_ = 0.0;
  share_ = (channelSum(emitted_) + punctual_.owed(1)) / kShotsOfAll;
  shot_level_.assign(patches_->nodeCount(), kNeverShot);
  shots_ = 0;
  settleError();
}

Result<StepOutcome> PaperSolver::step() {
  if (isDone()) return StepOutcome::kConverged;
  ShotBatch batch;
  batch.mode = LinkMode::kPaperMipmap;
  batch.flux_scale = trees_.fluxScale();
  if (punctual_.hasSlice(1)) {
    punctual_.addSlice(1, batch);
    emitted_ += emittedBy(batch);
  } else if (const auto node = chooseShooter()) {
    if (const auto shot = shotFrom(*node)) batch.scatter.push_back(*shot);
  }
  if (auto carried = carry(batch); !carried) return tl::unexpected(carried.error());
  settleError();
  if (isDone()) {  // by what polygons are taken to reflect in the mean, which may be too little
    trees_.pushPullAll();
    shown_.reset();
    settleError();
  }
  return isDone() ? StepOutcome::kConverged : StepOutcome::kShot;
}

const PatchTrees& PaperSolver::shown() const {
  if (!shown_) {
    shown_ = trees_;
    shown_->pushPullAll();
  }
  return *shown_;
}

/// Section 4.2, steps 1 and 2: the polygon with most unshot power is pushed and pulled, and its quadtree walked down.
/// None: nothing is left.
std::optional<NodePlace> PaperSolver::chooseShooter() {
  const auto& sides = trees_.sides();
  const auto best = std::ranges::max_element(sides, {}, &Side::unshot_power);
  if (best == sides.end() || !(best->unshot_power > 0.0)) return std::nullopt;
  const auto side = static_cast<std::uint32_t>(best - sides.begin());
  if (best->dirty) ++counters_.push_pulls;
  trees_.pushPull(side);
  return descend(side);
}

/// Section 4.2, steps 2 and 3: along the strongest child, until the children fall below the power of a shot.
NodePlace PaperSolver::descend(std::uint32_t number) const {
  const auto& side = trees_.sides()[number];
  NodePlace node{number, side.level_count - 1, 0, 0};
  while (node.level > 0) {
    const auto below = scene::levelGrid(side.width, side.height, node.level - 1);
    NodePlace best = node;
    double most = 0.0;
    for (auto y = 2 * node.y; y < std::min(2 * node.y + 2, below.height); ++y)
      for (auto x = 2 * node.x; x < std::min(2 * node.x + 2, below.width); ++x)
        if (const NodePlace child{number, node.level - 1, x, y}; trees_.power(nodeId(side, child)) > most) {
          most = trees_.power(nodeId(side, child));
          best = child;
        }
    if (most < share_) break;
    node = best;
  }
  return node;
}

/// Section 3: "a lower resolution hemicube when shooting less unshot power". A quarter of the power, half as many
/// pixels along a face.
std::uint32_t PaperSolver::resolutionFor(double power) const {
  auto n = settings_.planner.resolution;
  for (double p = power; p < 0.25 * share_ && n > kLeastResolution; p *= 4.0) n /= 2;
  for (double p = power; p > 4.0 * share_ && n < kMostResolution; p *= 0.25) n *= 2;
  return n;
}

/// The hemicube stands at a jittered place within the patch and is turned by chance (section 4.3). None: the patch has
/// no place to stand on, and what it had to send is lost (EnergyParts::imbalance).
std::optional<ScatterShot> PaperSolver::shotFrom(const NodePlace& node) {
  const auto& side = trees_.sides()[node.side];
  const auto id = nodeId(side, node);
  const double power = trees_.power(id);
  const auto flux = trees_.takeUnshot(node);
  const auto area = [&](std::uint32_t of) { return patches_->node_area[of]; };
  const auto key = mixKeys(mixKeys(settings_.seed, side.key), shots_);
  const glm::dvec4 point = sobol4(0, key);
  double u = point.x, v = point.y;
  const auto leaf = warpToLeaf(side, node, area, u, v);
  const auto& place = patches_->leaves[patches_->surfaces[side.surface].first_leaf + leaf];
  if (place.triangle == scene::kNone) return std::nullopt;
  const auto spot = patches_->spotAt(place, leaf % side.width, leaf / side.width, glm::vec2(glm::dvec2(u, v)));
  const auto& triangle = patches_->triangles[spot.triangle];
  ScatterShot shot;
  shot.frame = hemicubeAt(triangle.origin + spot.texel.x * triangle.du + spot.texel.y * triangle.dv,
                          side.side == 0 ? triangle.normal : -triangle.normal, point.z, key);
  shot.resolution = resolutionFor(power);
  shot.level_bias = kLevelBias;
  shot.flux = {flux.x, flux.y, flux.z};
  const auto leaves = leafRect(side, node);
  for (auto y = leaves.y0; y < leaves.y1; ++y)
    for (auto x = leaves.x0; x < leaves.x1; ++x)
      shot_level_[side.first_node + y * side.width + x] = static_cast<std::uint8_t>(node.level);
  ++shots_;
  ++counters_.shooters;
  if (node.level > 0) ++counters_.whole_subtrees;
  return shot;
}

/// Of light that arrives on a side, about: what leaves on the other.
double PaperSolver::passedPart(const Side& side) const {
  if (!trees_.letsThrough(side)) return 0.0;
  const auto mean = trees_.transmittance(side, side.node_count - 1);
  return (mean.x + mean.y + mean.z) / 3.0;
}

/// Section 4.1: what the pixels of the hemicube name gets the flux of their delta form factors.
Result<void> PaperSolver::carry(const ShotBatch& batch) {
  shown_.reset();
  if (batch.empty()) return {};
  flux_.reset(patches_->nodeCount());
  const auto counters = transport_.run(batch, flux_);
  if (!counters) return tl::unexpected(counters.error());
  transport_counters_ += *counters;
  trees_.receive(flux_);
  for (const auto& side : trees_.sides())
    for (std::uint32_t i = side.first_node; i < side.first_node + side.node_count; ++i)
      for (std::size_t c = 0; c < 3; ++c) {
        const double flux = static_cast<double>(flux_.node[0][i][c] + flux_.node[1][i][c]) / trees_.fluxScale();
        received_ += flux;
        reflected_ += flux * (static_cast<double>(side.mean_reflectance) + passedPart(side));
      }
  return {};
}

/// What is unshot, with all its further bounces, of what has arrived.
void PaperSolver::settleError() {
  const double unshot = trees_.totalPower() + punctual_.owed(1);
  const double rho = received_ > 0.0 ? std::clamp(reflected_ / received_, 0.0, 0.999) : 0.0;
  if (received_ > 0.0) {
    error_.residual = std::min(kNothingArrived, unshot / ((1.0 - rho) * received_));
  } else {
    error_.residual = unshot > 0.0 ? kNothingArrived : 0.0;
  }
  error_.sampling = error_.variation = error_.discretization = 0.0;
  error_.total = error_.residual;
}

void PaperSolver::setMaterials(const scene::PatchMaterials& materials) {
  materials_ = materials;
  startAnew();
}

void PaperSolver::setLights(const LightSources& sources) {
  sources_ = sources;
  startAnew();
}

void PaperSolver::setTargetError(double target) { settings_.target_error = target; }

std::vector<glm::vec3> PaperSolver::irradiance() const {
  const auto& trees = shown();
  std::vector<glm::vec3> values(patches_->nodeCount(), glm::vec3(0.0F));
  for (const auto& side : trees.sides())
    for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node)
      values[node] = glm::vec3(trees.irradiance(node));
  return values;
}

std::vector<glm::vec3> PaperSolver::unshot() const {
  const auto& trees = shown();
  std::vector<glm::vec3> values(patches_->nodeCount(), glm::vec3(0.0F));
  for (const auto& side : trees.sides())
    for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node)
      values[node] = glm::vec3(trees.unshot(node));
  return values;
}

EnergyParts PaperSolver::energy() const {
  const auto& trees = shown();
  glm::dvec3 absorbed(0.0), unshot(0.0);
  for (const auto& side : trees.sides())
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto node = side.first_node + leaf;
      const auto area = static_cast<double>(patches_->node_area[node]);
      absorbed += area * (1.0 - glm::dvec3(trees.reflectance(side, leaf))) * trees.irradiance(node);
      if (trees.letsThrough(side))
        absorbed -= area * trees.transmittance(side, leaf) * trees.irradiance(trees.otherOf(side).first_node + leaf);
      unshot += area * trees.unshot(node);
    }
  const auto escaped = trees.escaped(), backface = trees.backface();
  EnergyParts parts;
  for (int c = 0; c < 3; ++c) {
    const auto i = static_cast<std::size_t>(c);
    parts.emitted[i] = emitted_[c];
    parts.absorbed[i] = absorbed[c];
    parts.escaped[i] = escaped[c];
    parts.backface[i] = backface[c];
    parts.unshot[i] = unshot[c];
    parts.imbalance[i] = emitted_[c] - absorbed[c] - escaped[c] - backface[c] - unshot[c];
  }
  return parts;
}

template <typename Archive, typename Self>
void PaperSolver::visit(Archive& archive, Self& self) {
  archive(self.emitted_, self.received_, self.reflected_, self.share_, self.shot_level_, self.error_,
          self.transport_counters_, self.counters_, self.shots_);
  PatchTrees::visit(archive, self.trees_);
  PunctualLights::visit(archive, self.punctual_);
}

bool PaperSolver::save(ArchiveWriter& to) const {
  to(kKind, static_cast<std::uint64_t>(patches_->nodeCount()));
  visit(to, *this);
  return true;
}

bool PaperSolver::restore(ArchiveReader& from) {
  std::uint32_t kind = 0;
  std::uint64_t nodes = 0;
  from(kind, nodes);
  if (!from.ok() || kind != kKind || nodes != patches_->nodeCount()) return false;
  const auto sides = trees_.sides().size();
  visit(from, *this);
  return from.ok() && trees_.isWhole() && trees_.sides().size() == sides && shot_level_.size() == nodes;
}

}  // namespace radiosity::solver
