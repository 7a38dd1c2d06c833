#include "server/geometry/closed_parts.h"

#include <algorithm>
#include <bit>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>

#include "common/clones.h"

namespace radiosity::scene {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();
/// Parts are larger by this (unit box): well above what rounding moves positions.
constexpr float kMargin = 1e-5F;
/// Of eight boxes or parts, in units of Hits::work.
constexpr std::uint64_t kLookWork = 4;

/// 1 or 0: bits of a number, so that neither compiler makes a branch of them.
constexpr std::uint32_t isWithin(float low, float value, float high) {
  return static_cast<std::uint32_t>(low <= value) & static_cast<std::uint32_t>(value <= high);
}

}  // namespace

ClosedParts::Part::Part(std::uint32_t of, std::span<const Bvh::Triangle> triangles)
    : number(of), low(kInfinity), high(-kInfinity), lowest(kInfinity), highest(-kInfinity) {
  float largest = 0.0F;
  for (const auto& [a, b, c] : triangles) {
    const auto across = glm::cross(b - a, c - a);
    const float size = glm::length(across);
    if (!(size > largest)) continue;
    largest = size;
    normal = across / size;
  }
  for (const auto& triangle : triangles)
    for (const auto& corner : triangle) {
      low = glm::min(low, corner - kMargin);
      high = glm::max(high, corner + kMargin);
      lowest = std::min(lowest, glm::dot(normal, corner) - kMargin);
      highest = std::max(highest, glm::dot(normal, corner) + kMargin);
    }
}

ClosedParts::ClosedParts(std::span<const Part> parts) : count_(parts.size()) {
  std::vector<Bvh::Triangle> boxes;
  for (const auto& part : parts) boxes.push_back({part.low, part.high, part.high});
  const Bvh tree(std::move(boxes));
  nodes_ = WideNodes(tree, [&](std::uint32_t first, std::uint32_t count) {
    Block block{};
    block.lowest.fill(kInfinity);
    for (std::uint32_t k = 0; k < count; ++k) {
      const auto& part = parts[tree.order_[first + k]];
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto i = static_cast<int>(axis);
        block.low[axis][k] = part.low[i];
        block.high[axis][k] = part.high[i];
        block.normal[axis][k] = part.normal[i];
      }
      block.lowest[k] = part.lowest;
      block.highest[k] = part.highest;
      block.number[k] = part.number;
    }
    blocks_.push_back(block);
    return static_cast<std::uint32_t>(blocks_.size() - 1);
  });
}

/// As bits.
__attribute__((always_inline)) inline std::uint32_t ClosedParts::holding(const Block& block, const glm::vec3& place) {
  std::uint32_t bits[WideNodes::kWidth];
  for (std::size_t k = 0; k < WideNodes::kWidth; ++k) {
    const float height = block.normal[0][k] * place.x + block.normal[1][k] * place.y + block.normal[2][k] * place.z;
    const auto may =
        isWithin(block.low[0][k], place.x, block.high[0][k]) & isWithin(block.low[1][k], place.y, block.high[1][k]) &
        isWithin(block.low[2][k], place.z, block.high[2][k]) & isWithin(block.lowest[k], height, block.highest[k]);
    bits[k] = may << k;
  }
  std::uint32_t mask = 0;
  for (std::size_t k = 0; k < WideNodes::kWidth; ++k) mask |= bits[k];
  return mask;
}

__attribute__((always_inline)) inline std::uint32_t ClosedParts::holding(const WideNodes::Node& node,
                                                                         const glm::vec3& place) {
  std::uint32_t bits[WideNodes::kWidth];
  for (std::size_t k = 0; k < WideNodes::kWidth; ++k) {
    const auto may = isWithin(node.plane[0][k], place.x, node.plane[3][k]) &
                     isWithin(node.plane[1][k], place.y, node.plane[4][k]) &
                     isWithin(node.plane[2][k], place.z, node.plane[5][k]);
    bits[k] = may << k;
  }
  std::uint32_t mask = 0;
  for (std::size_t k = 0; k < WideNodes::kWidth; ++k) mask |= bits[k];
  return mask;
}

RADIOSITY_CLONES std::span<const std::uint32_t> ClosedParts::Search::next(std::uint64_t& work) noexcept {
  while (depth_ > 0) {
    const auto child = waiting_[--depth_];
    work += kLookWork;
    if ((child & WideNodes::kLeaf) == 0) {
      const auto& node = parts_.nodes_[child];
      for (auto mask = holding(node, place_); mask != 0; mask &= mask - 1)
        waiting_[depth_++] = node.child[static_cast<std::size_t>(std::countr_zero(mask))];
      continue;
    }
    const auto& block = parts_.blocks_[child & ~WideNodes::kLeaf];
    std::size_t count = 0;
    for (auto mask = holding(block, place_); mask != 0; mask &= mask - 1)
      found_[count++] = block.number[static_cast<std::size_t>(std::countr_zero(mask))];
    if (count > 0) return std::span(found_).first(count);
  }
  return {};
}

}  // namespace radiosity::scene
