#include "server/solver/solver.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

namespace radiosity::solver {
namespace {

/// A round may leave this part of the target error unshot: it is carried over, and small beside the sampling error.
constexpr double kResidualShare = 0.3;
/// Flux sums have headroom for this many rounds (RadiosityState::chooseFluxScale).
constexpr std::uint32_t kMaxRounds = 1024;

PlannerSettings plannerSettings(const SolverSettings& settings) {
  PlannerSettings planner = settings.planner;
  planner.seed = settings.seed;
  if (settings.paper_mode) {
    planner.mode = LinkMode::kPaperMipmap;
    planner.gather_nodes = false;
    planner.level_bias = 1.0F;  // "a LOD bias of one, with filtering by a 3 by 3 Gaussian filter"
  }
  return planner;
}

PunctualSettings punctualSettings(const SolverSettings& settings) {
  PunctualSettings punctual;
  punctual.seed = settings.seed;
  return punctual;
}

void addTo(TransportCounters& sum, const TransportCounters& term) {
  sum.scatter_shots += term.scatter_shots;
  sum.gather_shots += term.gather_shots;
  sum.gather_points += term.gather_points;
  sum.point_images += term.point_images;
  sum.parallel_images += term.parallel_images;
  sum.pixels += term.pixels;
  sum.links += term.links;
  sum.triangles_drawn += term.triangles_drawn;
  sum.triangles_culled += term.triangles_culled;
  sum.render_seconds += term.render_seconds;
  sum.accumulate_seconds += term.accumulate_seconds;
  sum.gather_seconds += term.gather_seconds;
}

void addEmitted(const ShotBatch& batch, std::array<double, 3>& sum) {
  for (std::size_t c = 0; c < 3; ++c) {
    for (const auto& shot : batch.point_lights) sum[c] += shot.emitted[c];
    for (const auto& shot : batch.parallel) sum[c] += shot.emitted[c];
  }
}

}  // namespace

Solver::Solver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
               solver::Transport& transport, const SolverSettings& settings, const LightSources& sources)
    : punctual_(*patches, sources, punctualSettings(settings)),
      state_(std::move(patches), materials, punctual_.owed(1)),
      transport_(transport),
      settings_(settings),
      planner_(state_.patches(), plannerSettings(settings)) {
  if (!settings_.paper_mode) lights_ = findLightPolygons(state_);
  startRound();
  publish();
}

void Solver::startRound() {
  state_.pushPullAll();
  polygons_due_ = !lights_.empty();
  phase_ = !polygons_due_ && !punctual_.hasSlice(state_.rounds()) ? Phase::kIndirect : Phase::kDirect;
  if (!settings_.paper_mode) {
    // More rounds can pay for finer links, and finer links leak less: half a level for each doubling.
    const auto rounds = static_cast<float>(state_.rounds());
    planner_.settings().level_bias = settings_.planner.level_bias - std::min(2.0F, 0.5F * std::log2(rounds));
  }
  planner_.startRound(roundPower());
}

/// What this round will shoot in all: in later rounds that is unshot already, in the first it is still to be reflected.
double Solver::roundPower() const {
  double power = 0.0;
  for (const auto& side : state_.sides()) power += side.unshot_power;
  return live_ ? power / (1.0 - meanReflectance(state_)) : power;
}

Result<void> Solver::run(const ShotBatch& batch) {
  batch_.reset(state_.patches().nodeCount());
  const auto counters = transport_.run(batch, batch_);
  if (!counters) return tl::unexpected<Error>(counters.error());
  addTo(transport_counters_, *counters);
  if (settings_.paper_mode) {
    for (const auto& side : state_.sides()) state_.smoothUnpushed(batch_, side);
  }
  state_.receive(batch_);
  return {};
}

Result<StepOutcome> Solver::step() {
  if (phase_ == Phase::kDone) return StepOutcome::kConverged;
  return phase_ == Phase::kDirect ? gatherDirect() : scatterIndirect();
}

Result<StepOutcome> Solver::gatherDirect() {
  ShotBatch batch;
  if (polygons_due_) {
    polygons_due_ = false;
    for (const auto& light : lights_) {
      const glm::dvec3 owed = light.undelivered(state_.rounds());
      for (int c = 0; c < 3; ++c) gather_emitted_[static_cast<std::size_t>(c)] += light.area * owed[c];
    }
    batch = planner_.gatherRound(state_, lights_);
  } else {
    batch.flux_scale = state_.fluxScale();
    punctual_.addSlice(state_.rounds(), batch);
    addEmitted(batch, gather_emitted_);
  }
  if (const auto done = run(batch); !done) return tl::unexpected<Error>(done.error());
  state_.pushPullAll();
  if (punctual_.hasSlice(state_.rounds())) {
    if (live_) publish();
    return StepOutcome::kShot;
  }
  phase_ = Phase::kIndirect;
  planner_.startRound(roundPower());
  if (live_) publish();
  return StepOutcome::kShot;
}

double Solver::owedPower() const {
  double power = punctual_.owed(state_.rounds());
  for (const auto& light : lights_) {
    const glm::dvec3 owed = glm::abs(light.undelivered(state_.rounds()));
    power += light.area * (owed.x + owed.y + owed.z);
  }
  return power;
}

double Solver::remainder() const {
  double received = 0.0;
  for (const auto& half : {state_.gathered(), state_.scattered()}) {
    for (const auto flux : half) received += static_cast<double>(flux) / state_.fluxScale();
  }
  return kResidualShare * settings_.target_error * received * (1.0 - meanReflectance(state_));
}

Result<StepOutcome> Solver::scatterIndirect() {
  const ShotBatch batch = planner_.scatterWave(state_, remainder());
  if (batch.scatter.empty() && batch.gather.empty() && planner_.exhausted()) return finishRound();
  if (const auto done = run(batch); !done) return tl::unexpected<Error>(done.error());
  if (live_) publish();
  return StepOutcome::kShot;
}

StepOutcome Solver::finishRound() {
  publish();
  live_ = false;
  error_ = estimateError(state_, owedPower());
  const double reached = settings_.paper_mode ? error_.residual : error_.total;
  const bool exhausted = state_.rounds() >= kMaxRounds;
  if (reached <= settings_.target_error || settings_.paper_mode || exhausted) {
    phase_ = Phase::kDone;
    return reached > settings_.target_error && exhausted ? StepOutcome::kExhausted : StepOutcome::kConverged;
  }
  state_.startRound();
  startRound();
  return StepOutcome::kRoundDone;
}

void Solver::assess() {
  if (!live_) return;
  publish();
  error_ = estimateError(state_, owedPower());
}

void Solver::publish() {
  state_.pushPullAll();
  irradiance_ = state_.nodeIrradiance();
}

void Solver::setTargetError(double target) {
  settings_.target_error = target;
  if (phase_ != Phase::kDone || settings_.paper_mode || error_.total <= target || state_.rounds() >= kMaxRounds) return;
  state_.startRound();
  startRound();
}

void Solver::setMaterials(const scene::PatchMaterials& materials) {
  state_.setMaterials(materials);
  if (!settings_.paper_mode) {
    const auto before = std::move(lights_);
    lights_ = findLightPolygons(state_);
    for (LightPolygon old : before) {
      const auto same =
          std::find_if(lights_.begin(), lights_.end(), [&](const auto& light) { return light.key == old.key; });
      if (same != lights_.end()) {
        same->delivered = old.delivered;
      } else {
        old.emission = glm::vec3(0.0F);  // its light is to be taken back
        lights_.push_back(old);
      }
    }
  }
  restartRound();
}

void Solver::setLights(const LightSources& sources) {
  punctual_.setSources(state_.patches(), sources);
  restartRound();
}

/// After an edit: the round goes on with what is now owed.
void Solver::restartRound() {
  live_ = true;
  startRound();
  publish();
  error_ = estimateError(state_, owedPower());
}

EnergyParts Solver::energy() const {
  return energyBalance(state_, planner_.intended(), gather_emitted_, punctual_.flux());
}

}  // namespace radiosity::solver
