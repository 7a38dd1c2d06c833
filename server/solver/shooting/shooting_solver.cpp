#include "server/solver/shooting/shooting_solver.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

namespace radiosity::solver {
namespace {

/// A round may leave this part of the target error unshot: it is carried over, and small beside the sampling error.
constexpr double kResidualShare = 0.3;

PlannerSettings plannerSettings(const SolverSettings& settings) {
  PlannerSettings planner = settings.planner;
  planner.seed = settings.seed;
  return planner;
}

PunctualSettings punctualSettings(const SolverSettings& settings) {
  PunctualSettings punctual;
  punctual.seed = settings.seed;
  punctual.rays_see_sky = false;
  return punctual;
}

void addEmitted(const ShotBatch& batch, std::array<double, 3>& sum) {
  for (std::size_t c = 0; c < 3; ++c) {
    for (const auto& shot : batch.point_lights) sum[c] += shot.emitted[c];
    for (const auto& shot : batch.parallel) sum[c] += shot.emitted[c];
    for (const auto& shot : batch.lamps) sum[c] += shot.emitted[c];
  }
}

}  // namespace

ShootingSolver::ShootingSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
                               Transport& transport, const SolverSettings& settings, const LightSources& sources)
    : punctual_(*patches, sources, punctualSettings(settings)),
      state_(std::move(patches), materials, punctual_.owed(1)),
      transport_(transport),
      settings_(settings),
      direct_(plannerSettings(settings), state_.patches().leaves.size()),
      planner_(state_.patches(), plannerSettings(settings)) {
  direct_.take(findLightPolygons(state_.patches(), state_.sides(), state_.emissions()));
  startRound();
  publish();
}

void ShootingSolver::startRound() {
  state_.pushPullAll();
  direct_.startRound(state_.rounds());
  phase_ = direct_.isDue() || punctual_.hasSlice(state_.rounds()) ? Phase::kDirect : Phase::kIndirect;
  // More rounds can pay for finer links, and finer links leak less: half a level for each doubling.
  const auto rounds = static_cast<float>(state_.rounds());
  planner_.settings().level_bias = settings_.planner.level_bias - std::min(2.0F, 0.5F * std::log2(rounds));
  planner_.startRound(roundPower());
}

/// What this round will shoot in all: in later rounds that is unshot already, in the first it is still to be reflected.
double ShootingSolver::roundPower() const {
  double power = 0.0;
  for (const auto& side : state_.sides()) power += side.unshot_power;
  return live_ ? power / (1.0 - meanReflectance(state_)) : power;
}

Result<StepOutcome> ShootingSolver::step() {
  if (wave_.underWay()) return advanceWave();
  if (phase_ == Phase::kDone) {
    return error_.total > settings_.target_error ? StepOutcome::kExhausted : StepOutcome::kConverged;
  }
  if (phase_ == Phase::kDirect) {
    planDirect();
  } else if (!planIndirect()) {
    return finishRound();
  }
  return advanceWave();
}

std::array<double, 3> ShootingSolver::emittedFlux() const {
  auto flux = gather_emitted_;
  for (std::size_t c = 0; c < 3; ++c) flux[c] += planner_.intended()[c];
  return flux;
}

void ShootingSolver::beginWave(ShotBatch batch, const std::array<double, 3>& emitted_before) {
  const auto emitted = emittedFlux();
  for (std::size_t c = 0; c < 3; ++c) wave_flux_[c] = emitted[c] - emitted_before[c];
  wave_.begin(std::move(batch), state_.patches());
}

/// The light polygons, then the other lights in slices.
void ShootingSolver::planDirect() {
  const auto before = emittedFlux();
  ShotBatch batch;
  if (direct_.isDue()) {
    batch = direct_.next(gather_emitted_);
  } else {
    punctual_.addSlice(state_.rounds(), batch);
    addEmitted(batch, gather_emitted_);
  }
  batch.flux_scale = state_.fluxScale();
  wave_is_direct_ = true;
  // An edit may send it back before the wave has landed.
  if (!direct_.isDue() && !punctual_.hasSlice(state_.rounds())) phase_ = Phase::kIndirect;
  beginWave(std::move(batch), before);
}

/// False: the round has nothing more to shoot.
bool ShootingSolver::planIndirect() {
  const auto before = emittedFlux();
  ShotBatch batch = planner_.scatterWave(state_, remainder());
  if (batch.scatter.empty() && batch.gather.empty() && planner_.exhausted()) return false;
  wave_is_direct_ = false;
  beginWave(std::move(batch), before);
  return true;
}

Result<StepOutcome> ShootingSolver::advanceWave() {
  const auto whole = wave_.advance(transport_, transport_counters_);
  if (!whole) return tl::unexpected<Error>(whole.error());
  if (!*whole) return StepOutcome::kSlice;
  land();
  return StepOutcome::kShot;
}

void ShootingSolver::land() {
  wave_flux_ = {};
  state_.receive(wave_.flux());
  if (wave_is_direct_) {
    state_.pushPullAll();
    planner_.startRound(roundPower());
  }
  if (live_) publish();
}

/// Light polygons' light that is still to be shot, and all light that is on its way.
double ShootingSolver::owedPower() const {
  double power = punctual_.owed(state_.rounds()) + direct_.owed();
  for (const double flux : wave_flux_) power += std::abs(flux);
  return power;
}

double ShootingSolver::remainder() const {
  double received = 0.0;
  for (const auto& half : {state_.gathered(), state_.scattered()}) {
    for (const auto flux : half) received += static_cast<double>(flux) / state_.fluxScale();
  }
  return kResidualShare * settings_.target_error * received * (1.0 - meanReflectance(state_));
}

StepOutcome ShootingSolver::finishRound() {
  publish();
  live_ = false;
  error_ = estimateError(state_, owedPower());
  const bool reached = error_.total <= settings_.target_error;
  if (reached || state_.rounds() >= kMaxRounds) {
    phase_ = Phase::kDone;
    return reached ? StepOutcome::kConverged : StepOutcome::kExhausted;
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
  if (phase_ != Phase::kDone || error_.total <= target || state_.rounds() >= kMaxRounds) return;
  state_.startRound();
  startRound();
}

void ShootingSolver::setMaterials(const scene::PatchMaterials& materials) {
  state_.setMaterials(materials);
  direct_.take(findLightPolygons(state_.patches(), state_.sides(), state_.emissions()));
  restartRound();
}

void ShootingSolver::setLights(const LightSources& sources) {
  punctual_.setSources(state_.patches(), sources);
  restartRound();
}

/// After an edit: the round goes on with what is now owed.
void ShootingSolver::restartRound() {
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

std::vector<glm::vec3> ShootingSolver::unshot() const {
  std::vector<glm::vec3> values(state_.patches().nodeCount(), glm::vec3(0.0F));
  const auto rounds = static_cast<float>(state_.rounds());
  for (const auto& side : state_.sides()) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      values[side.first_node + leaf] = state_.unshot(side, leaf) / rounds;
  }
  return values;
}

std::vector<std::uint8_t> ShootingSolver::shotLevels() const {
  std::vector<std::uint8_t> levels(state_.patches().nodeCount(), kNeverShot);
  for (const auto& side : state_.sides()) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      levels[side.first_node + leaf] = state_.shotLevel(side, leaf);
  }
  return levels;
}

EnergyParts ShootingSolver::energy() const {
  EnergyParts parts = energyBalance(state_, planner_.intended(), gather_emitted_, punctual_.flux());
  for (std::size_t c = 0; c < 3; ++c) {  // on its way: as good as unshot
    const double flux = wave_flux_[c] / static_cast<double>(state_.rounds());
    parts.unshot[c] += flux;
    parts.imbalance[c] -= flux;
  }
  return parts;
}

}  // namespace radiosity::solver
