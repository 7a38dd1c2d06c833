// LinkedSolver and the light that varies within leaves, of which its links know nothing.
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "common/parallel.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

/// It is asked for when all else is at most so many times the target, or this.
constexpr double kSoon = 3.0, kLittle = 0.1;
/// Each path asks all lights: with more than these it would take longer than the links.
constexpr std::size_t kMostLights = 512;
/// What is less than this part of the target is not looked into further: it adds a twentieth to the total.
constexpr double kNegligible = 0.3;
/// More paths are traced, and not more links measured, where what they would tell is so much of the square of the
/// error.
constexpr double kByPaths = 0.35;
/// What varies within leaves may take this much of the target and still leave links something to reach.
constexpr double kLeastByLinks = 0.5;

}  // namespace

/// Paths ask each lamp by itself, and those of a crowd are not among them.
bool LinkedSolver::hasTooManyLamps() const {
  return lights_.size() + sources_.size() > kMostLights ||
         std::ranges::any_of(crowds_, [](const Crowd& crowd) { return !crowd.isDark(); });
}

bool LinkedSolver::wantsVariation() const {
  if (variation_ || growing_ || !settings_.within_leaves || error_.total > std::max(kSoon * aim_, kLittle))
    return false;
  if (hasTooManyLamps()) return false;
  // There rays find most lamps, too, and where something cuts a leaf they know what varies.
  return patches_->opacity.empty();
}

/// assess() at an end of what the solver does, and not when somebody looks: then alone paths are traced first, so that
/// what they are does not depend on the clock.
/// False: some are still to be traced, go on with the next slice.
bool LinkedSolver::assessStep() {
  if (!std::exchange(is_tracing_, false)) {
    assess();
    if (!wantsVariation()) return true;
    if (!next_variation_)
      next_variation_ = std::make_unique<LeafVariation>(*patches_, sides_, settings_.seed, leafRays());
  }
  is_tracing_ = !updateVariation(*next_variation_, kSliceSeconds);
  if (is_tracing_) return false;
  variation_ = std::move(next_variation_);
  assess();
  return true;
}

void LinkedSolver::updateVariation() {
  if (!hasTooManyLamps()) return (void)updateVariation(*variation_, HUGE_VAL);
  variation_.reset();  // an edit lit them
  next_variation_.reset();
}

/// For the light that leaves have now. False: go on with the next slice.
bool LinkedSolver::updateVariation(LeafVariation& variation, double seconds) {
  variation.forgetCorrections();  // also where memory ends on the way
  const auto emission = shiningOfLeaves(), reflectance = ofLeaves(system_.reflectance());
  std::vector<double> squares(sides_.size(), 0.0);
  const auto sumUp = [&](std::size_t s) {
    const Side& side = sides_[s];
    double square = 0.0;  // in memory that no other thread writes to
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const glm::dvec3 irradiance(lightOf(side.first_value + leaf));
      square += static_cast<double>(patches_->node_area[side.first_node + leaf]) * glm::dot(irradiance, irradiance);
    }
    squares[s] = square;
  };
  inTurns(sides_.size(), sumUp, system_.leafAreas().size() / kLeavesAThread);
  const double square = square_ = std::accumulate(squares.begin(), squares.end(), 0.0);
  auto sources = sources_;  // paths find the sky where they end, and those before it by their numbers
  sources.insert(sources.end(), sky_.begin(), sky_.end());
  const SkyLight sky(sources);
  const double bound = kNegligible * aim_;
  return variation.update(
      {emission, reflectance, {half_[0], half_[1]}, lights_, sources, gathers() ? &gather_->sights() : nullptr, &sky},
      bound * bound * square, seconds);
}

/// What is to be reached by links, beside what varies within leaves.
double LinkedSolver::targetOfLinks() const {
  const double noise = error_.sampling * error_.sampling - by_links_ * by_links_;
  const double rest = aim_ * aim_ - noise - error_.variation * error_.variation;
  return std::max(std::sqrt(std::max(0.0, rest)), kLeastByLinks * aim_);
}

/// False: it is links that are wanted more, or more paths help no more.
bool LinkedSolver::refineVariation() {
  if (!variation_ || !variation_->corrects()) return false;
  if (variation_->unsettled() < kByPaths * error_.total * error_.total * square_ || !variation_->refine()) return false;
  updateVariation();
  assess();
  refined_ = true;
  return true;
}

}  // namespace radiosity::solver
