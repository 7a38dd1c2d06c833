#include "server/solver/variation/variation_stage.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "common/parallel.h"

namespace radiosity::solver {
namespace {

/// What is less than this part of the target is not looked into further: it adds a twentieth to the total.
constexpr double kNegligible = 0.3;
/// More paths are traced, and not more links measured, where what they would tell is so much of the square of the
/// error.
constexpr double kByPaths = 0.35;

}  // namespace

std::unique_ptr<LeafVariation> VariationStage::makePaths() const {
  return std::make_unique<LeafVariation>(patches_, sides_, seed_, rays_());
}

bool VariationStage::advance(const LeafLight& light, double aim, double seconds) {
  if (!next_paths_) next_paths_ = makePaths();
  is_tracing_ = !bringUpToDate(*next_paths_, light, aim, seconds);
  if (is_tracing_) return false;
  paths_ = std::move(next_paths_);
  return true;
}

void VariationStage::update(const LeafLight& light, double aim) { (void)bringUpToDate(*paths_, light, aim, HUGE_VAL); }

bool VariationStage::bringUpToDate(LeafVariation& paths, const LeafLight& light, double aim, double seconds) {
  paths.forgetCorrections();  // also where memory ends on the way
  std::vector<double> squares(sides_.size(), 0.0);
  const auto sumUp = [&](std::size_t s) {
    const Side& side = sides_[s];
    double square = 0.0;  // in memory that no other thread writes to
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto value = side.first_value + leaf;
      const glm::dvec3 irradiance(0.5F * (light.irradiance[0][value] + light.irradiance[1][value]));
      square += static_cast<double>(patches_.node_area[side.first_node + leaf]) * glm::dot(irradiance, irradiance);
    }
    squares[s] = square;
  };
  inTurns(sides_.size(), sumUp, light.irradiance[0].size() / kLeavesAThread);
  square_ = std::accumulate(squares.begin(), squares.end(), 0.0);
  const double bound = kNegligible * aim;
  return paths.update(light, bound * bound * square_, seconds);
}

bool VariationStage::refine(double total_error) {
  if (!paths_ || !paths_->corrects()) return false;
  return paths_->unsettled() >= kByPaths * total_error * total_error * square_ && paths_->refine();
}

void VariationStage::forget() {
  paths_.reset();
  next_paths_.reset();
}

std::span<const LeafVariation::Correction> VariationStage::corrections() const {
  return paths_ ? paths_->corrections() : std::span<const LeafVariation::Correction>();
}

void VariationStage::inherit(const VariationStage& former, std::span<const std::uint32_t> value_before,
                             const Shadows& shadows, bool same_lights, std::span<const LightPolygon> lights) {
  next_paths_ = makePaths();
  const auto reach = static_cast<float>(std::max(next_paths_->nearest(), former.paths_->nearest()));
  std::vector<LeafVariation::Tells> tells(value_before.size(), LeafVariation::Tells::kNothing);
  const auto tell = [&](std::size_t s) {
    for (auto value = sides_[s].first_value; value < sides_[s].first_value + sides_[s].leaf_count; ++value) {
      if (value_before[value] == scene::kNone) continue;
      const bool is_near = shadows.changesWithin(value, reach);
      tells[value] = is_near ? LeafVariation::Tells::kByWay : LeafVariation::Tells::kAll;
    }
  };
  inTurns(sides_.size(), tell, value_before.size() / kLeavesAThread);
  next_paths_->inherit(*former.paths_, value_before, tells, same_lights ? &shadows : nullptr, lights);
}

void VariationStage::save(ArchiveWriter& to) const {
  to(paths_ != nullptr);
  if (paths_) LeafVariation::visit(to, *paths_);
}

bool VariationStage::restore(ArchiveReader& from) {
  forget();
  bool is_traced = false;
  from(is_traced);
  if (!is_traced) return true;
  paths_ = makePaths();
  LeafVariation::visit(from, *paths_);
  return paths_->isWhole();
}

}  // namespace radiosity::solver
