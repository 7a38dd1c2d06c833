// The order in which rays from one place are traced: a packet of rays that go the same way takes half as long as one
// of rays that go all ways. Plain values; one thread.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <glm/vec4.hpp>
#include <numeric>
#include <vector>

#include "server/geometry/ray_scene.h"

namespace radiosity::solver {

/// Rays whose directions are drawn by two uniform numbers: a grid over these has about a packet in each cell, and cells
/// are traced row after row, there and back.
class RayOrder {
 public:
  struct Ray {
    std::uint32_t number;
    glm::dvec4 draw;  ///< x and y draw the direction
  };

  void clear() {
    rays_.clear();
    cell_.clear();
  }
  void add(std::uint32_t number, const glm::dvec4& draw) { rays_.push_back({number, draw}); }
  [[nodiscard]] std::size_t size() const { return rays_.size(); }
  /// After sort(): at `place` of the order.
  [[nodiscard]] const Ray& operator[](std::size_t place) const { return rays_[order_[place]]; }

  /// Once all are added. O(n).
  void sort() {
    const auto packets = static_cast<double>(rays_.size()) / geometry::kPacket;
    const auto across = std::max(1U, static_cast<std::uint32_t>(std::sqrt(packets)));
    first_.assign(std::size_t{across} * across + 1, 0);
    for (const auto& ray : rays_) {
      const auto row = static_cast<std::uint32_t>(ray.draw.x * across);
      const auto column = static_cast<std::uint32_t>(ray.draw.y * across);
      cell_.push_back(row * across + (row % 2 == 0 ? column : across - 1 - column));
      ++first_[cell_.back() + 1];
    }
    std::partial_sum(first_.begin(), first_.end(), first_.begin());
    order_.resize(rays_.size());
    for (std::uint32_t i = 0; i < rays_.size(); ++i) order_[first_[cell_[i]]++] = i;
  }

 private:
  std::vector<Ray> rays_;
  std::vector<std::uint32_t> cell_, order_, first_;
};

}  // namespace radiosity::solver
