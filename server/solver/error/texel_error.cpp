#include "server/solver/error/texel_error.h"

#include <algorithm>

namespace radiosity::solver {
namespace {

/// Leaves to each side that share the noise of one, where each has its own, and where it was smoothed.
constexpr std::int64_t kReach = 2, kSmoothReach = 6;

/// Sums of the values up to `reach` away from each leaf of a grid, one direction after the other.
template <typename T>
std::vector<T> boxSums(const std::vector<T>& values, std::int64_t width, std::int64_t height, std::int64_t reach) {
  std::vector<T> rows(values.size(), T(0.0)), sums(values.size(), T(0.0));
  for (std::int64_t y = 0; y < height; ++y) {
    for (std::int64_t x = 0; x < width; ++x) {
      auto& sum = rows[static_cast<std::size_t>(y * width + x)];
      for (auto i = std::max<std::int64_t>(0, x - reach); i <= std::min(width - 1, x + reach); ++i)
        sum += values[static_cast<std::size_t>(y * width + i)];
    }
  }
  for (std::int64_t y = 0; y < height; ++y) {
    for (auto i = std::max<std::int64_t>(0, y - reach); i <= std::min(height - 1, y + reach); ++i) {
      for (std::int64_t x = 0; x < width; ++x)
        sums[static_cast<std::size_t>(y * width + x)] += rows[static_cast<std::size_t>(i * width + x)];
    }
  }
  return sums;
}

/// Of all leaves by area, channel by channel.
glm::dvec3 meanSquare(const scene::PatchScene& patches, const std::vector<Side>& sides,
                      std::span<const glm::vec3> values) {
  glm::dvec3 sum(0.0);
  double area = 0.0;
  for (const auto& side : sides) {
    for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node) {
      const glm::dvec3 value(values[node]);
      sum += value * value * static_cast<double>(patches.node_area[node]);
      area += static_cast<double>(patches.node_area[node]);
    }
  }
  return area > 0.0 ? sum / area : glm::dvec3(0.0);
}

}  // namespace

std::vector<glm::vec3> texelErrorSquared(const scene::PatchScene& patches, std::span<const glm::vec3> first,
                                         std::span<const glm::vec3> second, std::span<const glm::vec3> mean,
                                         const ErrorParts& stated, std::span<const glm::vec3> common) {
  std::vector<glm::vec3> squares(patches.nodeCount(), glm::vec3(0.0F));
  const auto sides = makeSides(patches);
  const auto reach = common.empty() ? kReach : kSmoothReach;
  const auto mean_square = meanSquare(patches, sides, mean);
  const glm::dvec3 residual = stated.residual * stated.residual * mean_square;
  const glm::dvec3 variation = stated.variation * stated.variation * mean_square;
  for (const auto& side : sides) {
    std::vector<double> area(side.leaf_count);
    std::vector<glm::dvec3> sampling(side.leaf_count, glm::dvec3(0.0));
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      area[leaf] = static_cast<double>(patches.node_area[side.first_node + leaf]);
    const auto around = boxSums(area, side.width, side.height, reach);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      if (area[leaf] <= 0.0) continue;
      const glm::dvec3 half(0.5F * (first[side.first_node + leaf] - second[side.first_node + leaf]));
      sampling[leaf] = half * half * (area[leaf] / around[leaf]);
    }
    const auto shared = boxSums(sampling, side.width, side.height, reach);
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      if (area[leaf] <= 0.0) continue;
      const auto node = side.first_node + leaf;
      squares[node] = glm::vec3(shared[leaf] + residual + variation);
      if (!common.empty()) squares[node] += common[node];
    }
  }
  return squares;
}

}  // namespace radiosity::solver
