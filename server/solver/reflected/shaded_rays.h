// What each ray of a leaf counts for the leaf's shading normal. It follows from where the rays go alone, so that where
// it is kept other light costs no ray's direction again. Plain values; any thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace radiosity::solver {

/// The rays of some leaves, leaf after leaf.
class ShadedRays {
 public:
  /// By axis, what a ray brings to the vector of which the product with a normal is irradiance; and last to what of
  /// that product is not there, since it lies below the horizon of the shading normal. In the leaf's `unit`.
  using Weights = std::array<std::int16_t, 4>;
  /// Of a leaf: each of its four sums is that of weights times what rays see, and of `mean` times the mean of it.
  struct Leaf {
    std::size_t first = 0;
    std::uint32_t count = 0;
    double unit = 0.0;
    std::array<double, 4> mean{};
  };

  [[nodiscard]] bool empty() const { return leaves_.empty(); }
  void clear();
  /// Room for so many.
  void reserve(std::size_t leaves, std::size_t rays);

  /// The next leaf, whose `rays` are to be added; 0: it has too few to tell. `normal`: its shading normal; 0: none.
  void beginLeaf(std::uint32_t rays, const glm::dvec3& normal);
  /// A ray that starts on a face of this normal.
  void addRay(const glm::dvec3& face, const glm::dvec3& direction);

  [[nodiscard]] const Leaf& leaf(std::size_t number) const { return leaves_[number]; }
  [[nodiscard]] std::span<const Weights> weights(const Leaf& leaf) const {
    return std::span(weights_).subspan(leaf.first, leaf.count);
  }
  /// That so many take.
  [[nodiscard]] static std::size_t bytes(std::size_t leaves, std::size_t rays) {
    return leaves * sizeof(Leaf) + rays * sizeof(Weights);
  }

 private:
  std::vector<Leaf> leaves_;
  std::vector<Weights> weights_;
  // Of the leaf that was begun last:
  glm::dvec3 normal_{0.0};
  double least_ = 1.0, scale_ = 1.0;
};

}  // namespace radiosity::solver
