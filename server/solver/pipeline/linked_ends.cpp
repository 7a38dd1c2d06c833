// LinkedSolver: what it ended with for light and colours that come again.
#include <bit>
#include <memory>
#include <utility>

#include "server/solver/math/sampling.h"
#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {
namespace {

std::uint64_t keyOf(const glm::vec3& value) {
  const auto bits = [](float x) { return std::uint64_t{std::bit_cast<std::uint32_t>(x)}; };
  return mixKeys(bits(value.x) << 32U | bits(value.y), bits(value.z));
}

/// Of the leaves, which are all that light depends on.
std::uint64_t keyOf(const scene::SideColours& colours, const std::vector<Side>& sides) {
  std::uint64_t key = 0;
  for (const auto& side : sides) {
    const auto of_side = colours.side(side.number);
    for (std::uint32_t leaf = 0; leaf < (of_side.isUniform() ? 1 : side.leaf_count); ++leaf)
      key = mixKeys(key, keyOf(of_side[leaf]));
  }
  return key;
}

/// Dark ones are as if they were not there.
std::uint64_t keyOf(const PunctualLights::Source& source) {
  if (source.intensity == glm::dvec3(0.0)) return 0;
  std::uint64_t key = source.shapeKey();
  for (int c = 0; c < 3; ++c) key = mixKeys(key, std::bit_cast<std::uint64_t>(source.intensity[c]));
  return key;
}

}  // namespace

std::uint64_t LinkedSolver::lightKey() const {
  std::uint64_t sources = 0;  // in whatever order
  for (const auto& source : sources_) sources += keyOf(source);
  for (const auto& source : sky_) sources += keyOf(source);
  auto key = mixKeys(mixKeys(keyOf(system_.emission(), sides_), keyOf(system_.reflectance(), sides_)), sources);
  if (!system_.passing().empty()) key = mixKeys(key, keyOf(system_.transmittance(), sides_));
  return mirrors_ ? mixKeys(key, mirrors_->key()) : key;
}

/// What it ended with for this light before, if that reaches the target. False: there is no such end.
bool LinkedSolver::takeKeptEnd() {
  if (repair_.lacksLinks()) return false;
  const auto kept = ends_.find(lightKey());
  if (!kept || !(kept->error.total <= settings_.target_error)) return false;
  half_ = kept->half;
  shaded_.set(kept->shaded);
  error_ = kept->error;
  shown_ = kept;
  phase_ = Phase::kDone;
  return true;
}

/// The solve is done, and reaches its target: what it ended with for this light before is told again, or else what
/// there is now is kept.
void LinkedSolver::endHere() {
  phase_ = Phase::kDone;
  if (takeKeptEnd() || repair_.lacksLinks()) return;
  auto end = std::make_shared<KeptEnd>();
  end->key = lightKey();
  end->half = half_;
  end->shaded = shaded_.values();
  end->error = error_;
  end->common = commonOfLeaves();
  const auto corrections = this->corrections();
  end->corrections.assign(corrections.begin(), corrections.end());
  ends_.keep(std::move(end));
}

std::span<const LeafVariation::Correction> LinkedSolver::corrections() const {
  return shown_ ? shown_->corrections : variation_.corrections();
}

}  // namespace radiosity::solver
