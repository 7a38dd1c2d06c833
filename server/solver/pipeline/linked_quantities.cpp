// What LinkedSolver shows of itself, leaf by leaf.
#include <algorithm>
#include <glm/common.hpp>
#include <iterator>
#include <vector>

#include "server/solver/pipeline/linked_solver.h"

namespace radiosity::solver {

/// All light there is, with what leaves lack.
std::vector<glm::vec3> LinkedSolver::irradiance() const {
  std::vector<glm::vec3> values(patches_->nodeCount(), glm::vec3(0.0F));
  for (const auto& side : sides_) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      values[side.first_node + leaf] = lightOf(side.first_value + leaf);
  }
  shaded_.addTo(kBothHalves, values);
  for (const auto& [value, lacks] : corrections()) {
    auto& light = values[nodeOf(value)];
    const auto more = shaded_.correction(value, lightOf(value), 0.5F * (lacks[0] + lacks[1]));
    light = glm::max(light + more, glm::vec3(0.0F));  // by noise it might be less
  }
  return values;
}

std::uint32_t LinkedSolver::nodeOf(std::uint32_t value) const {
  const auto after = std::ranges::upper_bound(sides_, value, {}, &Side::first_value);
  const Side& side = *std::prev(after);
  return side.first_node + (value - side.first_value);
}

std::vector<glm::vec3> LinkedSolver::halfIrradiance(std::uint32_t half) const {
  std::vector<glm::vec3> values(patches_->nodeCount(), glm::vec3(0.0F));
  for (const auto& side : sides_)
    std::copy_n(half_[half].begin() + side.first_value, side.leaf_count, values.begin() + side.first_node);
  shaded_.addTo(half, values);
  for (const auto& correction : corrections())
    values[nodeOf(correction.value)] +=
        shaded_.correction(correction.value, lightOf(correction.value), correction.lacks[half]);
  return values;
}

std::vector<glm::vec3> LinkedSolver::unshot() const {
  std::vector<glm::vec3> values(patches_->nodeCount(), glm::vec3(0.0F)), leaves;
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    leafUnshot(s, leaves);
    std::copy(leaves.begin(), leaves.end(), values.begin() + sides_[s].first_node);
  }
  return values;
}

std::vector<std::uint8_t> LinkedSolver::shotLevels() const {
  std::vector<std::uint8_t> levels(patches_->nodeCount(), kNeverShot);
  for (const auto& shooter : system_.shooters()) {
    if (shooter.isLight()) continue;
    const Side& side = sides_[shooter.place.side];
    const auto level = static_cast<std::uint8_t>(shooter.place.level);
    const auto rect = leafRect(side, shooter.place);
    for (auto y = rect.y0; y < rect.y1; ++y) {
      for (auto x = rect.x0; x < rect.x1; ++x) {
        auto& known = levels[side.first_node + y * side.width + x];
        known = std::min(known, level);
      }
    }
  }
  for (const auto& side : sides_) {  // rays see single leaves
    for (std::uint32_t leaf = 0; leaf < side.leaf_count && gathers(); ++leaf)
      if (patches_->node_area[side.first_node + leaf] > 0.0F) levels[side.first_node + leaf] = 0;
  }
  return levels;
}

/// What smoothing took of the light of lamps and of that of rays, by leaf value; empty: there are no rays.
std::vector<float> LinkedSolver::commonOfLeaves() const {
  if (!gathers()) return {};
  const auto of_rays = gather_->biasOfLeaves(), of_lamps = direct_smoothing_.biasOfLeaves();
  std::vector<float> common(of_rays.begin(), of_rays.end());
  for (std::size_t value = 0; value < of_lamps.size(); ++value) common[value] += of_lamps[value];
  return common;
}

/// Of all channels together: each has of it as it has of the leaf's light.
std::vector<glm::vec3> LinkedSolver::commonErrorSquared() const {
  const auto common = shown_ ? shown_->common : commonOfLeaves();
  if (common.empty()) return {};
  std::vector<glm::vec3> squares(patches_->nodeCount(), glm::vec3(0.0F));
  for (const auto& side : sides_) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const glm::vec3 irradiance = lightOf(side.first_value + leaf), square = irradiance * irradiance;
      const float all = square.x + square.y + square.z;
      const glm::vec3 parts = all > 0.0F ? square / all : glm::vec3(1.0F / 3.0F);
      squares[side.first_node + leaf] = common[side.first_value + leaf] * parts;
    }
  }
  return squares;
}

}  // namespace radiosity::solver
