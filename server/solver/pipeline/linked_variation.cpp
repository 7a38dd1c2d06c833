// LinkedSolver and the light that varies within leaves, of which its links know nothing.
#include <algorithm>
#include <cmath>
#include <functional>

#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

/// It is asked for when all else is at most so many times the target, or this.
constexpr double kSoon = 3.0, kLittle = 0.1;
/// Each path asks all lights: with more than these it would take longer than the links.
constexpr std::size_t kMostLights = 512;
/// What varies within leaves may take this much of the target and still leave links something to reach.
constexpr double kLeastByLinks = 0.5;

}  // namespace

/// Paths ask each lamp by itself, and those of a crowd are not among them.
bool LinkedSolver::hasTooManyLamps() const {
  return lights_.size() + sources_.size() > kMostLights ||
         std::ranges::any_of(crowds_, [](const Crowd& crowd) { return !crowd.isDark(); });
}

bool LinkedSolver::wantsVariation() const {
  if (variation_.isTraced() || growing_ || !settings_.within_leaves || error_.total > std::max(kSoon * aim_, kLittle))
    return false;
  if (hasTooManyLamps()) return false;
  // There rays find most lamps, too, and where something cuts a leaf they know what varies.
  return patches_->opacity.empty();
}

/// assess() at an end of what the solver does, and not when somebody looks: then alone paths are traced first, so that
/// what they are does not depend on the clock.
/// False: some are still to be traced, go on with the next slice.
bool LinkedSolver::assessStep() {
  if (!variation_.isTracing()) {
    assess();
    if (!wantsVariation()) return true;
  }
  const auto advance = [this](const LeafLight& light) { return variation_.advance(light, aim_, kSliceSeconds); };
  if (!withLeafLight(advance)) return false;
  assess();
  return true;
}

void LinkedSolver::updateVariation() {
  if (!variation_.isTraced()) return;
  if (hasTooManyLamps()) return variation_.forget();  // an edit lit them
  const auto update = [this](const LeafLight& light) {
    variation_.update(light, aim_);
    return true;
  };
  (void)withLeafLight(update);
}

/// The light that leaves have now.
bool LinkedSolver::withLeafLight(const std::function<bool(const LeafLight&)>& work) const {
  const auto emission = shiningOfLeaves(), reflectance = ofLeaves(system_.reflectance());
  std::array<std::vector<glm::vec3>, 2> passed;
  for (std::size_t half = 0; half < 2 && !system_.passing().empty(); ++half) {
    passed[half].assign(emission.size(), glm::vec3(0.0F));
    for (const auto& leaf : system_.passing()) passed[half][leaf.to] = leaf.of(half_[half]);
  }
  auto sources = sources_;  // paths find the sky where they end, and those before it by their numbers
  sources.insert(sources.end(), sky_.begin(), sky_.end());
  const SkyLight sky(sources);
  return work({emission,
               reflectance,
               {half_[0], half_[1]},
               lights_,
               sources,
               gathers() ? &gather_->sights() : nullptr,
               &sky,
               {passed[0], passed[1]}});
}

/// What is to be reached by links, beside what varies within leaves.
double LinkedSolver::targetOfLinks() const {
  const double noise = error_.sampling * error_.sampling - by_links_ * by_links_;
  const double rest = aim_ * aim_ - noise - error_.variation * error_.variation;
  return std::max(std::sqrt(std::max(0.0, rest)), kLeastByLinks * aim_);
}

/// False: it is links that are wanted more, or more paths help no more.
bool LinkedSolver::refineVariation() {
  if (!variation_.refine(error_.total)) return false;
  updateVariation();
  assess();
  refined_ = true;
  return true;
}

}  // namespace radiosity::solver
