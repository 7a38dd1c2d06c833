// How LinkedSolver brings light to the leaves over the links it has: slice by slice.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "common/parallel.h"
#include "server/solver/math/halves.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

/// Roulette weights that change for less than this part of the power need no new solution.
constexpr double kSameWeights = 0.05;

}  // namespace

/// True: the equation is solved.
bool LinkedSolver::advanceSolution() {
  if (!system_.advance(kSliceSeconds)) return false;
  const auto sweeps = static_cast<std::uint64_t>(system_.sweeps());
  ++solutions_;
  sweeps_ += sweeps;
  replayed_ += sweeps * system_.shooters().size();
  return true;
}

/// Solves all bounces over the links there are, and lights every leaf. False: not yet, go on with the next slice.
bool LinkedSolver::settle() {
  if (pass_ == Pass::kNone) {
    (void)planner_.weigh(system_);
    system_.begin();
    pass_ = Pass::kFirst;
  }
  if (pass_ == Pass::kFirst) {
    if (!advanceSolution()) return false;
    std::vector<std::array<double, 2>> weights;
    for (const auto& shooter : system_.shooters()) weights.push_back(shooter.weight);
    if (planner_.weigh(system_) > kSameWeights) {  // shooters that were dark before had no weight
      system_.begin();
      pass_ = Pass::kSecond;
    } else {
      for (std::size_t n = 0; n < weights.size(); ++n) system_.shooters()[n].weight = weights[n];
    }
  }
  if (pass_ == Pass::kSecond && !advanceSolution()) return false;
  return lightLeaves();
}

/// Where rays bring the rest.
ShadedLight::Values LinkedSolver::smoothDirect(DirectSmoothing& smoothing, DirectSmoothing::Halves& halves) const {
  if (!gather_) return {};
  const auto is_parted = [this](std::uint32_t value) { return gather_->sights().isParted(value); };
  DirectSmoothing::Halves raw;
  if (!shaded_.empty()) raw = halves;
  smoothing.smooth(sides_, system_.leafAreas(), is_parted, halves);
  return shaded_.empty() ? ShadedLight::Values{} : shaded_.factors(raw, halves);
}

/// What of the light over links comes through coloured glass. False: not yet, go on with the next slice.
bool LinkedSolver::tintLinks() {
  if (!tints_.isNeeded()) return true;
  if (pass_ != Pass::kTints) {
    std::vector<LightTints::Sender> senders;
    looking_.clear();
    for (std::uint32_t n = 0; n < system_.shooters().size(); ++n) {
      const auto& shooter = system_.shooters()[n];
      if (shooter.column[0].points() + shooter.column[1].points() <= 0.0) continue;
      if (shooter.crowd != scene::kNone && !crowds_[shooter.crowd].lamps) continue;
      looking_.push_back(n);
      senders.push_back(shooter.light != scene::kNone    ? LightTints::of(lights_[shooter.light])
                        : shooter.source != scene::kNone ? LightTints::of(sources_[shooter.source])
                        : shooter.crowd != scene::kNone
                            ? LightTints::of(crowds_[shooter.crowd])
                            : LightTints::of(sides_[shooter.place.side], shooter.place, leafRays()));
    }
    tints_.begin(std::move(senders), leafRays());
    pass_ = Pass::kTints;
  }
  if (!tints_.advance(kSliceSeconds)) return false;
  tinted_ = looking_;
  for (std::size_t i = 0; i < tinted_.size(); ++i) {
    for (std::size_t half = 0; half < 2; ++half) system_.shooters()[tinted_[i]].tint[half] = tints_.tint(i, half);
  }
  tint_noise_ = system_.tintNoise();
  return true;
}

/// By the links, solved for, and then by the rays. False: not yet, go on with the next slice.
bool LinkedSolver::lightLeaves() {
  if (pass_ != Pass::kRays && !tintLinks()) return false;
  if (pass_ != Pass::kRays) {
    expander_.forget();
    inBothHalves([&](std::size_t half) { system_.irradiance(half, over_links_[half]); });
    shaded_.scaleNext(smoothDirect(direct_smoothing_, over_links_));
    pass_ = Pass::kRays;
    if (gather_) gather_->begin(leftLight());
  }
  const bool is_done = !gather_ || gather_->advance(kSliceSeconds);
  if (gather_ && gather_->mirroredLamps().hasNoRoomFor(in_mirrors_)) {
    findImages();  // there are none any more, and what they would have brought is spread
    gather_->begin(leftLight());
    return false;
  }
  if (!is_done) return false;
  half_ = std::move(over_links_);
  if (gather_) {
    inBothHalves([&](std::size_t half) {
      for (std::size_t v = 0; v < half_[half].size(); ++v) half_[half][v] += gather_->irradiance(half)[v];
    });
  }
  shaded_.update(shootersAndLights(), gather_.get());
  if (gather_) gather_->forgetIrradiance();
  pass_ = Pass::kNone;
  findUnshot();
  updateVariation();
  return true;
}

void LinkedSolver::findUnshot(Unshot which) {
  varying_ = net_unshot_ = 0.0;
  if (isAllSent(which)) return unshot_.clear();
  unshot_.begin();
  const auto pull = [&](std::size_t s) {
    std::vector<glm::vec3> unshot;
    leafUnshot(static_cast<std::uint32_t>(s), unshot, which);
    unshot_.pull(sides_[s], unshot);
  };
  inTurns(sides_.size(), pull, system_.leafAreas().size() / kLeavesAThread);
  for (const Side& side : sides_) {
    const auto root = side.first_node + side.node_count - 1;
    const auto net = static_cast<double>(channelSum(unshot_.flux(root)));
    net_unshot_ += net;
    varying_ += std::max(0.0, static_cast<double>(unshot_.rough(root)) - net);
  }
}

/// Radiosity less what stands for it on the deepest shooter above each leaf.
void LinkedSolver::leafUnshot(std::uint32_t s, std::vector<glm::vec3>& leaves, Unshot which) const {
  const Side& side = sides_[s];
  if (isAllSent(which)) {
    leaves.assign(side.leaf_count, glm::vec3(0.0F));
    return;
  }
  system_.standIn(s, leaves);
  const auto emission = system_.emission().side(s), reflectance = system_.reflectance().side(s);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const glm::vec3 own = side.gathered ? glm::vec3(0.0F) : emission[leaf];
    leaves[leaf] = reflectance[leaf] * lightOf(side.first_value + leaf) + own - leaves[leaf];
  }
  for (const auto& leaf : passingTo(system_.passing(), side))
    leaves[leaf.to - side.first_value] += leaf.transmittance * lightOf(leaf.from);
}

/// After an edit: the next steps solve over the links there are. What was still to be measured will be asked for again.
void LinkedSolver::solveAnew() {
  if (memory_.isMostlyRows(system_)) dropNodes();
  rounds_before_edit_ = rounds_;
  wave_.clear();
  settling_ = false;
  pass_ = Pass::kNone;
  from_links_ = FromLinks::kAfterEdit;
  refined_ = is_confirmed_ = false;
  variation_.stopTracing();
  assessing_ = Assessed::kNothing;
  edit_lights_planned_ = false;
  error_ = {};  // unknown
  shown_ = nullptr;
}

/// All shooters but lights, because the equation alone would take the memory of their links: surfaces that had one
/// reflectance have textures now, and a row for each channel. As many as there is room for will be found again.
void LinkedSolver::dropNodes() {
  std::vector<Shooter> lights;
  std::vector<std::uint32_t> number(system_.shooters().size(), scene::kNone);
  for (std::uint32_t n = 0; n < number.size(); ++n) {
    if (!system_.shooters()[n].isLight()) continue;
    number[n] = static_cast<std::uint32_t>(lights.size());
    lights.push_back(std::move(system_.shooters()[n]));
  }
  system_.clear();
  tinted_.clear();
  for (const auto& light : lights) (void)system_.add(light);
  repair_.renumber(number);
}

/// What follows is to assess what there is. False: the light is to be solved for again, since there was no room for the
/// links of a new lamp and others had to go, or after more repairs (isRepairing).
bool LinkedSolver::finishEdit() {
  wave_.clear();
  memory_.begin(system_);
  bool forgot = false;
  while (memory_.isOverdrawn() && forgetWeakest()) forgot = true;
  if (forgot) return false;
  memory_.forgive();
  from_links_ = FromLinks::kNo;
  lights_fit_ = true;
  growing_ = true;
  phase_ = Phase::kLights;
  const auto& shooters = system_.shooters();
  if ((net_unshot_ > 0.0 || gathers()) &&
      std::ranges::none_of(shooters, [](const Shooter& shooter) { return shooter.owes(); })) {
    // Where nothing needs links that are not there, the solution over those that are is the end already.
    {
      const AllUnshot all(*this);
      startGrowth();
      wave_.begin(plan());
    }
    growing_ = !wave_.wanted().empty() && (wantsLamp() || !mayGoWithout());
  }
  return true;
}

/// False: as finishEdit().
bool LinkedSolver::choosesAfterEdit() {
  if (isDueForTarget()) {
    wave_.clear();
    from_links_ = FromLinks::kAfterEdit;
    return false;
  }
  if (takeKeptEnd()) {
    wave_.clear();
    return true;
  }
  const bool lacks_lamp = growing_ && wantsLamp();
  if (error_.total <= settings_.target_error && !lacks_lamp) {
    wave_.clear();
    endHere();
  } else if (!growing_) {
    ++rounds_;
    (void)chooseFurther();
  }
  return true;
}

/// What shines by itself and is small: rays may not find it at all, and then do not tell that they did not.
bool LinkedSolver::wantsLamp() const {
  if (!gathers()) return false;
  return std::ranges::any_of(wave_.wanted(), [&](const Measurement& want) {
    const auto& shooter = system_.shooters()[want.shooter];
    return !shooter.isLight() && sideShines(shooter.place.side);
  });
}

/// After an edit some node or other is just strong enough to be a shooter now. Where the target is reached while the
/// few that are wanted send nothing, which counts as light that is missing, they are not worth another wave.
bool LinkedSolver::mayGoWithout() {
  if (wave_.wanted().size() >= settings_.planner.pairs_a_wave)
    return false;  // the walk may have ended before it was through
  growing_ = false;
  assess();
  return error_.total <= settings_.target_error;
}

/// From nothing but the links: the result depends on them, on light and materials, and on the target, so that an edit
/// and its inverse give the same bits as long as no link, no shooter without links (mayGoWithout) and no path was added
/// in between. False: not yet.
bool LinkedSolver::settleFromLinks() {
  const auto forgetLight = [&] {
    for (auto& shooter : system_.shooters()) {
      if (shooter.isLight()) continue;
      shooter.mean.fill(glm::vec3(0.0F));
      shooter.sent.fill(glm::vec3(0.0F));
    }
    system_.begin();
  };
  if (pass_ == Pass::kNone) {
    for (auto& shooter : system_.shooters()) {
      for (std::size_t half = 0; half < 2 && !shooter.isLight(); ++half)
        shooter.weight[half] = shooter.column[half].points() > 0.0 ? 1.0 : 0.0;
    }
    forgetLight();
    pass_ = Pass::kFirst;
  }
  if (pass_ == Pass::kFirst) {
    if (!advanceSolution()) return false;
    // It showed how strong the shooters are, for their roulette.
    double power = 0.0;
    for (const auto& shooter : system_.shooters()) {
      if (!shooter.isLight()) power += shooter.power();
    }
    if (power > 0.0)
      planner_.setShare(power / settings_.planner.first_shooters);  // weak beside the light that there is now
    (void)planner_.weigh(system_);
    system_.begin();  // from the first solution, which depends on nothing else either
    pass_ = Pass::kSecond;
  }
  if (pass_ == Pass::kSecond && !advanceSolution()) return false;
  return lightLeaves();
}

}  // namespace radiosity::solver
