#include "server/solver/error/field_error.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

namespace radiosity::solver {
namespace {

/// Bilinear interpolation at leaf (x, y) of the area-weighted means of 2 x 2 leaves.
class ParentLevel {
 public:
  ParentLevel(const scene::PatchScene& patches, const Side& side, std::span<const glm::vec3> leaves)
      : width_((side.width + 1) / 2),
        height_((side.height + 1) / 2),
        mean_(std::size_t{width_} * height_),
        area_(mean_.size(), 0.0F) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const std::size_t parent = std::size_t{leaf / side.width / 2} * width_ + leaf % side.width / 2;
      const float area = patches.node_area[side.first_node + leaf];
      mean_[parent] += leaves[leaf] * area;
      area_[parent] += area;
    }
    for (std::size_t i = 0; i < mean_.size(); ++i) {
      if (area_[i] > 0.0F) mean_[i] /= area_[i];
    }
  }

  /// At the middle of a leaf. False where one of the four parents around it is empty, or beyond the side.
  [[nodiscard]] bool at(std::uint32_t x, std::uint32_t y, glm::vec3& value) const {
    const std::uint32_t right = (x + 1) / 2, below = (y + 1) / 2;
    if (right < 1 || below < 1 || right >= width_ || below >= height_) return false;
    const std::size_t i = std::size_t{below - 1} * width_ + right - 1;
    if (area_[i] <= 0.0F || area_[i + 1] <= 0.0F || area_[i + width_] <= 0.0F || area_[i + width_ + 1] <= 0.0F)
      return false;
    const float u = x % 2 == 0 ? 0.75F : 0.25F, v = y % 2 == 0 ? 0.75F : 0.25F;
    value = (1.0F - v) * ((1.0F - u) * mean_[i] + u * mean_[i + 1]) +
            v * ((1.0F - u) * mean_[i + width_] + u * mean_[i + width_ + 1]);
    return true;
  }

 private:
  std::uint32_t width_, height_;
  std::vector<glm::vec3> mean_;
  std::vector<float> area_;
};

}  // namespace

void FieldError::addSide(const Side& side, std::span<const glm::vec3> first, std::span<const glm::vec3> second) {
  const ParentLevel coarse_first(patches_, side, first), coarse_second(patches_, side, second);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto area = static_cast<double>(patches_.node_area[side.first_node + leaf]);
    if (area <= 0.0) continue;
    const glm::dvec3 mean(0.5F * (first[leaf] + second[leaf])), difference(0.5F * (first[leaf] - second[leaf]));
    const double square = area * glm::dot(mean, mean);
    square_ += square;
    spread_ += area * glm::dot(difference, difference);
    glm::vec3 a, b;
    if (coarse_first.at(leaf % side.width, leaf / side.width, a) &&
        coarse_second.at(leaf % side.width, leaf / side.width, b)) {
      // The halves are independent, so their noise cancels in the product and the bend of the surface remains.
      bent_ += area * glm::dot(glm::dvec3(first[leaf] - a), glm::dvec3(second[leaf] - b));
      bent_square_ += square;
    }
  }
}

void FieldError::add(const FieldError& other) {
  square_ += other.square_;
  spread_ += other.spread_;
  bent_ += other.bent_;
  bent_square_ += other.bent_square_;
}

double FieldError::sampling() const { return square_ > 0.0 ? std::sqrt(spread_ / square_) : 0.0; }

double FieldError::discretization() const {
  return bent_square_ > 0.0 ? std::sqrt(std::max(0.0, bent_) / bent_square_) / 3.0 : 0.0;
}

}  // namespace radiosity::solver
