#include "server/solver/links/roulette.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <tuple>

#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Bits of `value`, `apart` bits from one to the next.
std::uint64_t spreadBits(std::uint32_t value, std::uint32_t apart) {
  std::uint64_t bits = 0;
  for (std::uint32_t k = 0; k < 20 && (value >> k) != 0; ++k) bits |= std::uint64_t{(value >> k) & 1U} << (k * apart);
  return bits;
}

/// 0 to 5: the axis, and its sign, that the side faces most.
std::uint32_t facing(const glm::vec3& normal) {
  const glm::vec3 size = glm::abs(normal);
  const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
  return 2U * static_cast<std::uint32_t>(axis) + (normal[axis] < 0.0F ? 1U : 0U);
}

/// Along Morton's curve through the scene, 1024 cells a side.
std::uint64_t curvePlace(const scene::Surface& surface) {
  const glm::vec3 centre = 0.5F * (surface.bounds_min + surface.bounds_max);
  const glm::vec3 cell = glm::clamp((centre + 0.5F) * 1024.0F, 0.0F, 1023.0F);
  std::uint64_t place = 0;
  for (int axis = 0; axis < 3; ++axis)
    place |= spreadBits(static_cast<std::uint32_t>(cell[axis]), 3) << static_cast<unsigned>(axis);
  return place;
}

}  // namespace

RouletteDraws::RouletteDraws(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed)
    : sides_(sides), seed_(seed), rank_(sides.size()) {
  std::vector<std::tuple<std::uint32_t, std::uint64_t, std::uint32_t>> order;
  order.reserve(sides.size());
  for (std::uint32_t s = 0; s < sides.size(); ++s) {
    const auto& surface = patches.surfaces[sides[s].surface];
    const auto& normal = patches.triangles[surface.first_triangle].normal;
    order.emplace_back(facing(sides[s].side == 0 ? normal : -normal), curvePlace(surface), s);
  }
  std::sort(order.begin(), order.end());
  for (std::uint32_t k = 0; k < order.size(); ++k) rank_[std::get<2>(order[k])] = k;
  rank_end_ = static_cast<std::uint32_t>(order.size());
}

void RouletteDraws::inherit(const RouletteDraws& former, const std::vector<std::uint32_t>& side_after) {
  std::vector<std::uint32_t> before(rank_.size(), scene::kNone);
  for (std::size_t s = 0; s < side_after.size(); ++s) {
    if (side_after[s] != scene::kNone) before[side_after[s]] = former.rank_[s];
  }
  const std::uint32_t first_new = former.rank_end_;
  for (std::size_t s = 0; s < rank_.size(); ++s)
    rank_[s] = before[s] != scene::kNone ? before[s] : first_new + rank_[s];
  rank_end_ = first_new + rank_end_;
}

double RouletteDraws::draw(const NodePlace& node, std::size_t half) const {
  // Nodes of equal depth follow each other: those of one depth tend to be of one power.
  const std::uint32_t depth = sides_[node.side].level_count - 1 - node.level;
  const auto below = spreadBits(node.x, 2) | (spreadBits(node.y, 2) << 1U);
  const auto index = static_cast<std::uint32_t>((std::uint64_t{rank_[node.side]} << (2U * depth)) + below);
  return sobol4(index, mixKeys(mixKeys(seed_, half), 77 + depth)).x;
}

}  // namespace radiosity::solver
