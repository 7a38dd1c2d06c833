// A Bvh with eight boxes below each (Wald, Benthin and Boulos 2008, "Getting rid of packets"), which a ray is held
// against together, in single precision. What lies in its leaves SolidTree decides. Immutable once
// built.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <functional>
#include <glm/vec3.hpp>
#include <vector>

#include "server/geometry/bvh.h"

namespace radiosity::scene {

/// Eight triangles at most, to be tested together.
struct alignas(32) TriangleLanes {
  template <typename T>
  using Lanes = std::array<T, 8>;
  std::array<Lanes<float>, 3> corner{}, edge1{}, edge2{};
  Lanes<float> slack{};  ///< times the longer edge: what is off by less counts as met

  void set(std::size_t lane, const Bvh::Triangle& triangle, float slack_of_edge);
};

class WideNodes {
 public:
  static constexpr std::uint32_t kWidth = 8;
  /// Of a tree of 2^32 triangles, seven of eight children waiting at each level.
  static constexpr std::size_t kStackDepth = 512;
  /// Set in the number of a leaf.
  static constexpr std::uint32_t kLeaf = 1U << 31U;

  struct alignas(32) Node {
    std::array<std::array<float, kWidth>, 6> plane;  ///< low x, y, z, high x, y, z; grown by more than rounding
    std::array<std::uint32_t, kWidth> child;         ///< kLeaf: what the leaf was numbered; else a node
  };

  struct Ray {
    float origin[3], direction[3], inverse[3];
    std::size_t near[3], far[3];  ///< which planes of a box it meets first, and last

    Ray(const glm::vec3& from, const glm::vec3& way) {
      constexpr float kLeast = 1e-20F;  // instead of the component of a direction that is 0
      for (std::size_t axis = 0; axis < 3; ++axis) {
        const auto i = static_cast<int>(axis);
        origin[axis] = from[i];
        direction[axis] = way[i];
        inverse[axis] = 1.0F / (std::abs(way[i]) > kLeast ? way[i] : kLeast);
        const bool up = inverse[axis] > 0.0F;
        near[axis] = up ? axis : axis + 3;
        far[axis] = up ? axis + 3 : axis;
      }
    }
  };

  WideNodes() = default;
  /// O(n). `leaf`: numbers so many of the Bvh's triangles from the first, leaf after leaf; kWidth at most.
  WideNodes(const Bvh& tree, const std::function<std::uint32_t(std::uint32_t first, std::uint32_t count)>& leaf);

  [[nodiscard]] bool empty() const { return nodes_.empty(); }
  [[nodiscard]] const Node& operator[](std::uint32_t node) const { return nodes_[node]; }

  /// Which children of a node the ray meets before t_max, as bits; `entry`: where it comes in.
  __attribute__((always_inline)) static std::uint32_t meet(const Node& node, const Ray& ray, float t_max,
                                                           float* entry) {
    const float* near[3];
    const float* far[3];
    for (std::size_t axis = 0; axis < 3; ++axis) {
      near[axis] = node.plane[ray.near[axis]].data();
      far[axis] = node.plane[ray.far[axis]].data();
    }
    std::uint32_t bits[kWidth];
    for (std::size_t k = 0; k < kWidth; ++k) {
      const float ax = (near[0][k] - ray.origin[0]) * ray.inverse[0], bx = (far[0][k] - ray.origin[0]) * ray.inverse[0];
      const float ay = (near[1][k] - ray.origin[1]) * ray.inverse[1], by = (far[1][k] - ray.origin[1]) * ray.inverse[1];
      const float az = (near[2][k] - ray.origin[2]) * ray.inverse[2], bz = (far[2][k] - ray.origin[2]) * ray.inverse[2];
      float in = ax > ay ? ax : ay;
      in = in > az ? in : az;
      in = in > 0.0F ? in : 0.0F;
      float out = bx < by ? bx : by;
      out = out < bz ? out : bz;
      out = out < t_max ? out : t_max;
      entry[k] = in;
      bits[k] = in <= out ? 1U << k : 0U;
    }
    std::uint32_t mask = 0;
    for (std::size_t k = 0; k < kWidth; ++k) mask |= bits[k];
    return mask;
  }

 private:
  using NumberLeaf = std::function<std::uint32_t(std::uint32_t, std::uint32_t)>;
  [[nodiscard]] static std::vector<std::uint32_t> childrenOf(const Bvh& tree, std::uint32_t node,
                                                             const std::vector<std::uint32_t>& count);
  [[nodiscard]] std::uint32_t addLeaf(const NumberLeaf& leaf, std::uint32_t first, std::uint32_t count);

  std::vector<Node> nodes_;
};

}  // namespace radiosity::scene
