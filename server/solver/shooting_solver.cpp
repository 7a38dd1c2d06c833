#include "server/solver/shooting_solver.h"

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

}  // namespace

ShootingSolver::ShootingSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
               solver::Transport& transport, const SolverSettings& settings)
    : state_(std::move(patches), materials),
      transport_(transport),
      settings_(settings),
      planner_(state_.patches(), plannerSettings(settings)) {
  if (!settings_.paper_mode) lights_ = findLightPolygons(state_.patches(), state_.sides(), state_.emissions());
  startRound();
  publish();
}

void ShootingSolver::startRound() {
  state_.pushPullAll();
  phase_ = lights_.empty() ? Phase::kIndirect : Phase::kDirect;
  if (!settings_.paper_mode) {
    // More rounds can pay for finer links, and finer links leak less: half a level for each doubling.
    const auto rounds = static_cast<float>(state_.rounds());
    planner_.settings().level_bias = settings_.planner.level_bias - std::min(2.0F, 0.5F * std::log2(rounds));
  }
  planner_.startRound(roundPower());
}

/// What this round will shoot in all: in later rounds that is unshot already, in the first it is still to be reflected.
double ShootingSolver::roundPower() const {
  double power = 0.0;
  for (const auto& side : state_.sides()) power += side.unshot_power;
  return live_ ? power / (1.0 - meanReflectance(state_)) : power;
}

Result<void> ShootingSolver::run(const ShotBatch& batch) {
  batch_.reset(state_.patches().nodeCount());
  const auto counters = transport_.run(batch, batch_);
  if (!counters) return tl::unexpected<Error>(counters.error());
  transport_counters_ += *counters;
  if (settings_.paper_mode) {
    for (const auto& side : state_.sides()) state_.smoothUnpushed(batch_, side);
  }
  state_.receive(batch_);
  return {};
}

Result<StepOutcome> ShootingSolver::step() {
  if (phase_ == Phase::kDone) return StepOutcome::kConverged;
  return phase_ == Phase::kDirect ? gatherDirect() : scatterIndirect();
}

Result<StepOutcome> ShootingSolver::gatherDirect() {
  for (const auto& light : lights_) {
    const glm::dvec3 owed = light.undelivered(state_.rounds());
    for (int c = 0; c < 3; ++c) gather_emitted_[static_cast<std::size_t>(c)] += light.area * owed[c];
  }
  const ShotBatch batch = planner_.gatherRound(state_, lights_);
  if (const auto done = run(batch); !done) return tl::unexpected<Error>(done.error());
  phase_ = Phase::kIndirect;
  state_.pushPullAll();
  planner_.startRound(roundPower());
  if (live_) publish();
  return StepOutcome::kShot;
}

double ShootingSolver::owedPower() const {
  double power = 0.0;
  for (const auto& light : lights_) {
    const glm::dvec3 owed = glm::abs(light.undelivered(state_.rounds()));
    power += light.area * (owed.x + owed.y + owed.z);
  }
  return power;
}

double ShootingSolver::remainder() const {
  double received = 0.0;
  for (const auto& half : {state_.gathered(), state_.scattered()}) {
    for (const auto flux : half) received += static_cast<double>(flux) / state_.fluxScale();
  }
  return kResidualShare * settings_.target_error * received * (1.0 - meanReflectance(state_));
}

Result<StepOutcome> ShootingSolver::scatterIndirect() {
  const ShotBatch batch = planner_.scatterWave(state_, remainder());
  if (batch.scatter.empty() && batch.gather.empty() && planner_.exhausted()) return finishRound();
  if (const auto done = run(batch); !done) return tl::unexpected<Error>(done.error());
  if (live_) publish();
  return StepOutcome::kShot;
}

StepOutcome ShootingSolver::finishRound() {
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

void ShootingSolver::assess() {
  if (!live_) return;
  publish();
  error_ = estimateError(state_, owedPower());
}

void ShootingSolver::publish() {
  state_.pushPullAll();
  irradiance_ = state_.nodeIrradiance();
}

void ShootingSolver::setTargetError(double target) {
  settings_.target_error = target;
  if (phase_ != Phase::kDone || settings_.paper_mode || error_.total <= target || state_.rounds() >= kMaxRounds) return;
  state_.startRound();
  startRound();
}

void ShootingSolver::setMaterials(const scene::PatchMaterials& materials) {
  state_.setMaterials(materials);
  if (!settings_.paper_mode) {
    const auto before = std::move(lights_);
    lights_ = findLightPolygons(state_.patches(), state_.sides(), state_.emissions());
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
  live_ = true;
  startRound();
  publish();
  error_ = estimateError(state_, owedPower());
}

std::vector<glm::vec3> ShootingSolver::halfIrradiance(std::uint32_t half) const {
  std::vector<glm::vec3> values(state_.patches().nodeCount(), glm::vec3(0.0F));
  for (const auto& side : state_.sides()) {
    state_.halfIrradiance(side, half, std::span(&values[side.first_node], side.leaf_count));
  }
  return values;
}

EnergyParts ShootingSolver::energy() const { return energyBalance(state_, planner_.intended(), gather_emitted_); }

}  // namespace radiosity::solver
