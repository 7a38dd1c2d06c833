#include "server/solver/patches/unshot_pyramid.h"

#include <cmath>

#include "common/give_back.h"

namespace radiosity::solver {

float channelSum(const glm::vec3& v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); }
double channelSum(const glm::dvec3& v) { return std::abs(v.x) + std::abs(v.y) + std::abs(v.z); }

void UnshotPyramid::clear() {
  giveBack(flux_);
  giveBack(rough_);
}

void UnshotPyramid::begin() {
  flux_.resize(patches_.nodeCount(), glm::vec3(0.0F));
  rough_.resize(patches_.nodeCount(), 0.0F);
}

void UnshotPyramid::pull(const Side& side, std::span<const glm::vec3> unshot) {
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    flux_[side.first_node + leaf] = unshot[leaf] * patches_.node_area[side.first_node + leaf];
    rough_[side.first_node + leaf] = channelSum(flux_[side.first_node + leaf]);
  }
  for (std::uint32_t level = 1; level < side.level_count; ++level) {
    const auto grid = scene::levelGrid(side.width, side.height, level);
    const auto child = scene::levelGrid(side.width, side.height, level - 1);
    const std::uint32_t first = side.first_node + grid.offset, below = side.first_node + child.offset;
    std::fill_n(flux_.begin() + first, grid.width * grid.height, glm::vec3(0.0F));
    std::fill_n(rough_.begin() + first, grid.width * grid.height, 0.0F);
    for (std::uint32_t y = 0; y < child.height; ++y) {
      for (std::uint32_t x = 0; x < child.width; ++x) {
        const std::uint32_t parent = first + (y >> 1U) * grid.width + (x >> 1U);
        flux_[parent] += flux_[below + y * child.width + x];
        rough_[parent] += rough_[below + y * child.width + x];
      }
    }
  }
}

}  // namespace radiosity::solver
