#include "server/solver/pipeline/linked_solver.h"
#include "common/parallel.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <new>
#include <string>
#include <system_error>
#include <utility>

#include "server/solver/error/field_error.h"

namespace radiosity::solver {
namespace {

/// Before the first was timed: as many measurements, of some images each, as draw so many triangles.
constexpr std::size_t kFirstTriangles = 1'600'000;
constexpr std::size_t kFewestMeasurements = 8;

/// A small error is worked towards by way of larger ones, from the first of these on, each so many times the next. That
/// takes no longer, and whoever looks before the end, or sets a limit of time, sees as much light as somebody who asked
/// for less.
constexpr double kFirstAim = 0.02, kAimStep = 2.0;

/// What solves ended with for other light takes so much at most, or a sixteenth of what links may.
constexpr std::size_t kMostEndBytes = std::size_t{64} << 20U;

SliceLength firstSlice(const scene::PatchScene& patches) {
  const auto most =
      std::clamp<std::size_t>(kFirstTriangles / std::max<std::size_t>(1, patches.triangles.size()), 2, 16);
  return {most, std::min(most, kFewestMeasurements)};
}

/// Of --link-memory a part like this may be taken by colours of light over links.
constexpr std::size_t kTintMemory = 16;

PunctualSettings punctualSettings(const SolverSettings& settings) {
  PunctualSettings punctual;
  punctual.seed = settings.seed;
  return punctual;
}

}  // namespace

LinkedSolver::LinkedSolver(std::shared_ptr<const scene::PatchScene> patches, Transport& transport,
                           const SolverSettings& settings)
    : patches_(std::move(patches)),
      transport_(transport),
      settings_(settings),
      sides_(makeSides(*patches_)),
      punctual_(*patches_, {}, punctualSettings(settings)),
      shots_(*patches_, sides_, settings.seed),
      system_(*patches_, sides_),
      expander_(*patches_, sides_),
      memory_(*patches_, sides_, settings.link_memory / 2),  // rays may take the other half
      unshot_(*patches_),
      planner_(*patches_, sides_, shots_, settings_.planner, settings_.seed),
      tints_(*patches_, sides_, settings.seed, settings.link_memory / kTintMemory),
      parts_{*patches_, sides_, lights_, shots_, settings_, system_, expander_, memory_, transport_},
      repair_(
          parts_, [this] { return leafRays(); }, firstSlice(*patches_)),
      wave_(
          parts_, {punctual_, sources_, crowds_}, [this] { return leafRays(); }, firstSlice(*patches_)),
      shaded_(*patches_, sides_),
      variation_(*patches_, sides_, settings_.seed, [this] { return leafRays(); }),
      ends_(std::min(kMostEndBytes, settings_.link_memory / 16)) {
  aim_ = std::max(settings_.target_error, kFirstAim);
  planner_.setTarget(aim_);
}

LinkedSolver::LinkedSolver(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
                           Transport& transport, const SolverSettings& settings, const LightSources& sources)
    : LinkedSolver(std::move(patches), transport, settings) {
  key_ends_ = {static_cast<std::uint32_t>(patches_->nodeCount()),
               static_cast<std::uint32_t>(patches_->triangles.size())};
  takeMaterials(materials);
  takeSources(sources);
  for (auto& half : half_) half.assign(system_.leafAreas().size(), glm::vec3(0.0F));
  findUnshot();
}

void LinkedSolver::shadeFor(std::shared_ptr<const scene::ShadingNormals> normals) {
  shaded_.shadeFor(std::move(normals));
  if (gather_) gather_->shadeFor(&shaded_.shading());
}

void LinkedSolver::takeMaterials(const scene::PatchMaterials& materials) {
  system_.setMaterials(materials.emission, materials.reflectance, materials.transmittance);
  mirrors_ = SpecularLeaves::find(sides_, materials, patches_->surfaces);
  if (gather_) gather_->reflectBy(mirrors_);
  takeLights();
  findImages();
  double area = 0.0;
  glm::dvec3 reflectance(0.0);
  for (const auto& side : sides_) {
    const auto of_side = system_.reflectance().side(side.number);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto a = static_cast<double>(patches_->node_area[side.first_node + leaf]);
      reflectance += a * glm::dvec3(of_side[leaf]);
      area += a;
    }
  }
  for (const auto& leaf : system_.passing())
    reflectance += glm::dvec3(leaf.transmittance * system_.leafAreas()[leaf.to]);
  planner_.setReflectance(area > 0.0 ? std::max({reflectance.x, reflectance.y, reflectance.z}) / area : 0.0);
}

/// Of what an edit of geometry may have changed.
Result<void> LinkedSolver::repairSlice() {
  const auto done = repair_.advance(phase_ == Phase::kDone && from_links_ == FromLinks::kNo);
  if (!done) return tl::unexpected<Error>(done.error());
  counters_ += *done;
  return {};
}

void LinkedSolver::startGrowth() {
  const AllUnshot all(*this);
  double power = 0.0;
  std::vector<double> least;
  const auto find = [&](std::size_t part) {
    if (part == 0) power = powerToShoot();
    if (part == 1) least = leastRadiosity();
  };
  doShares(2, ShareOfWork(find));
  planner_.setShare(power / settings_.planner.first_shooters);
  planner_.setLeastRadiosity(std::move(least));
  phase_ = Phase::kGrow;
}

std::vector<Measurement> LinkedSolver::plan() {
  memory_.begin(system_);
  if (phase_ == Phase::kLights) return planLights();
  if (phase_ == Phase::kImprove) {
    if (sample_goal_ <= 0.0) return {};
    return planner_.improve(system_, memory_, {std::sqrt(noise().links), sample_goal_});
  }
  if (planner_.share() <= 0.0) return {};
  // Also where there is no room: the walk finds out how much light goes without.
  const std::size_t limit = std::max<std::size_t>(settings_.planner.pairs_a_wave, system_.shooters().size() / 2);
  // What rays bring is left to them, but for what after an edit is bright and small.
  const AllUnshot all(*this);
  return planner_.grow(system_, unshot_, *patches_, limit, memory_);
}

Result<StepOutcome> LinkedSolver::step() {
  try {
    return advance();
  } catch (const std::bad_alloc&) {
    pass_ = Pass::kNone;  // what was half done is begun anew
    assessing_ = Assessed::kNothing;
    variation_.stopTracing();
    return fail(ErrorCode::kTooLarge, "out of memory with " + std::to_string(system_.shooters().size()) +
                                          " shooters and " + std::to_string(system_.bytes() >> 20U) +
                                          " MiB of links; fewer texels, or a larger error, need less");
  } catch (const std::system_error& error) {
    pass_ = Pass::kNone;
    assessing_ = Assessed::kNothing;
    variation_.stopTracing();
    return fail(ErrorCode::kUnavailable, std::string("no thread to solve with: ") + error.what());
  }
}

Result<StepOutcome> LinkedSolver::advance() {
  if (assessing_ != Assessed::kNothing) return assessed();
  if (!settling_ && wave_.forgetRough()) phase_ = Phase::kLights;
  if (isRepairing()) {
    if (const auto done = repairSlice(); !done) return tl::unexpected<Error>(done.error());
    // Nothing else asks for the light over links that were the last to be measured.
    if (!repair_.lacksLinks() && phase_ == Phase::kDone && from_links_ == FromLinks::kNo)
      from_links_ = FromLinks::kToConfirm;
    return StepOutcome::kSlice;
  }
  if (from_links_ == FromLinks::kAfterEdit) {
    if (repair_.lightsAreTooRough()) return StepOutcome::kSlice;
    if (!edit_lights_planned_) {  // what was switched on, or moved: all that follows depends on its light
      memory_.begin(system_);
      wave_.begin(planLights());
      edit_lights_planned_ = true;
    }
    if (!wave_.isMeasured()) {
      if (const auto done = wave_.advance(counters_); !done) return tl::unexpected<Error>(done.error());
      return StepOutcome::kSlice;
    }
    if (!settleFromLinks() || findsMoreDue()) return StepOutcome::kSlice;
    if (!finishEdit()) return StepOutcome::kSlice;
    assessing_ = Assessed::kEdit;
    return assessed();
  }
  if (from_links_ == FromLinks::kToConfirm) return confirm();
  if (std::exchange(refined_, false)) return chooseNext();
  if (phase_ == Phase::kDone) {
    if (!repair_.lacksLinks()) return ended();
    repair_.catchUp();
    return advance();
  }
  if (!settling_ && wave_.isMeasured()) {
    if (findsMoreDue()) return StepOutcome::kSlice;
    wave_.begin(plan());
    const bool dark = phase_ == Phase::kLights && net_unshot_ + varying_ <= 0.0;
    if (wave_.wanted().empty() && phase_ == Phase::kImprove && !gather_->isBehind() &&
        !tints_.isBehind())  // no sample that there is room for can lower the error
      return exhausted(memory_.lacksSamples() || memory_.isFull() ? SolveLimit::kLinkMemory : SolveLimit::kPatches);
    if (wave_.wanted().empty() && (dark || phase_ == Phase::kGrow)) return finishRound();
  }
  if (!settling_ && !wave_.wanted().empty()) {
    if (const auto done = wave_.advance(counters_); !done) return tl::unexpected<Error>(done.error());
    if (!wave_.isMeasured()) return StepOutcome::kSlice;
  }
  settling_ = true;  // also where memory runs out
  // Over the few links that there are beside rays nothing is gained by going on from the light before.
  const bool from_nothing = phase_ == Phase::kImprove;
  settling_ = !(from_nothing ? settleFromLinks() : settle());
  if (settling_) return StepOutcome::kSlice;
  is_confirmed_ = from_nothing;
  if (phase_ == Phase::kImprove) return finishRound();
  if (phase_ == Phase::kLights) startGrowth();
  return StepOutcome::kShot;
}

/// An edit is taken in whole: its links would not be true otherwise.
void LinkedSolver::endWave() {
  if (gather_ && from_links_ == FromLinks::kNo) tryNow([this] { gather_->giveUp(); });
  if (pass_ != Pass::kTints) tints_.giveUp();
  if (isRepairing() || from_links_ != FromLinks::kNo || settling_ || assessing_ != Assessed::kNothing) return;
  if (wave_.endInHaste()) settling_ = wave_.isMeasured();
}

StepOutcome LinkedSolver::finishRound() {
  growing_ = false;
  ++rounds_;
  refined_ = true;
  assessing_ = Assessed::kRound;
  return assessed();
}

/// Goes on from where something was reached, as soon as all is known of it.
StepOutcome LinkedSolver::assessed() {
  if (!assessStep()) return StepOutcome::kSlice;
  switch (std::exchange(assessing_, Assessed::kNothing)) {
    case Assessed::kRound:
      refined_ = false;
      return chooseNext();
    case Assessed::kEdit:
      if (!choosesAfterEdit()) return StepOutcome::kSlice;
      return phase_ == Phase::kDone ? ended() : StepOutcome::kShot;
    default:
      if (error_.total > settings_.target_error) return chooseFurther();
      endHere();
      return StepOutcome::kConverged;
  }
}

/// What waits may be what is missing.
StepOutcome LinkedSolver::exhausted(SolveLimit limit) {
  if (repair_.lacksLinks() && !isRepairing()) {
    beExact();
    from_links_ = FromLinks::kToConfirm;
    return StepOutcome::kSlice;
  }
  if (aimFurther()) return chooseNext();
  limit_ = limit;
  phase_ = Phase::kDone;
  return StepOutcome::kExhausted;
}

/// What a solver in kDone says: it may have got there because nothing more can be done.
StepOutcome LinkedSolver::ended() const {
  return error_.total <= settings_.target_error ? StepOutcome::kConverged : StepOutcome::kExhausted;
}

StepOutcome LinkedSolver::chooseNext() {
  const bool is_confirmed = std::exchange(is_confirmed_, false);
  limit_ = SolveLimit::kNone;
  refined_ = true;  // should memory run out, it is chosen anew
  while (error_.total <= aim_ && aimFurther()) continue;
  const bool blotched = error_.total <= settings_.target_error && refineBlotches();
  refined_ = false;
  if (error_.total > settings_.target_error) return chooseFurther();
  if (blotched) return StepOutcome::kRoundDone;
  if (is_confirmed) {
    endHere();
    return StepOutcome::kConverged;
  }
  from_links_ = FromLinks::kToConfirm;
  return confirm();
}

/// False: the target itself is aimed at already.
bool LinkedSolver::aimFurther() {
  if (aim_ <= settings_.target_error) return false;
  aim_ = std::max(aim_ / kAimStep, settings_.target_error);
  planner_.setTarget(aim_);
  if (!variation_.isTraced()) return true;
  updateVariation();
  assess();
  return true;
}

/// A solve that is done depends on its links and rays alone, not on the way to them.
StepOutcome LinkedSolver::confirm() {
  if (!settleFromLinks()) return StepOutcome::kSlice;
  from_links_ = FromLinks::kNo;
  assessing_ = Assessed::kSolution;
  return assessed();
}

StepOutcome LinkedSolver::chooseFurther() {
  const auto& shooters = system_.shooters();
  const auto owes = [](const Shooter& shooter) { return shooter.owes(); };
  if (lights_fit_ && std::any_of(shooters.begin(), shooters.end(), owes)) {
    phase_ = Phase::kLights;
    return StepOutcome::kRoundDone;
  }
  if (refineVariation()) return StepOutcome::kRoundDone;
  refined_ = true;  // should memory run out, it is chosen anew
  const auto next = chooseRays();
  refined_ = false;
  return next;
}

void LinkedSolver::setTargetError(double target) {
  rounds_before_edit_ = rounds_;
  const bool was_shown = std::exchange(shown_, nullptr) != nullptr;
  settings_.target_error = target;
  aim_ = std::max(aim_, target);
  planner_.setTarget(aim_);
  tryNow([this] { updateVariation(); });
  if (assessing_ != Assessed::kNothing) return;  // which is for this target
  if (phase_ == Phase::kImprove && gather_ && from_links_ == FromLinks::kNo && !isRepairing() &&
      error_.total <= target) {  // what the wave still brings is not needed, and may take as long as all before it
    tryNow([this] { gather_->giveUp(); });
    if (pass_ != Pass::kTints) tints_.giveUp();
    wave_.endHere();
    settling_ = true;
  }
  if (phase_ != Phase::kDone || from_links_ != FromLinks::kNo) return;
  // What was told is of an end before; what the links and rays that there are now say is to be solved for.
  if (was_shown) return (void)(from_links_ = FromLinks::kToConfirm);
  tryNow([this] {
    limit_ = SolveLimit::kNone;
    while (error_.total <= aim_ && aimFurther()) continue;
    if (error_.total > settings_.target_error) (void)chooseFurther();
    if (error_.total <= settings_.target_error) from_links_ = FromLinks::kToConfirm;
    const auto is_behind = [this] { return (gather_ && gather_->isBehind()) || tints_.isBehind() || lacksTint(); };
    while (from_links_ == FromLinks::kToConfirm && !is_behind()) (void)confirm();
  });
}

void LinkedSolver::setMaterials(const scene::PatchMaterials& materials) {
  takeMaterials(materials);
  solveAnew();
}

void LinkedSolver::setLights(const LightSources& sources) {
  takeSources(sources);
  solveAnew();
}

}  // namespace radiosity::solver
