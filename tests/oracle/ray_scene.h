// What rays meet among triangles, in double precision and in plain code: the program under test asks Embree. In a box
// of size 2 about the origin, so that lengths that are lost in rounding are the same for all scenes. Immutable; any
// thread.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec3.hpp>
#include <limits>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {

class RayScene {
 public:
  /// O(n log^2 n).
  explicit RayScene(std::span<const Triangle> triangles);

  [[nodiscard]] glm::dvec3 toUnit(const glm::dvec3& world) const { return (world - centre_) * scale_; }
  [[nodiscard]] double scale() const { return scale_; }  ///< lengths in the box over lengths in the world

  struct Met {
    double distance = 0.0;  ///< in lengths of the way
    std::uint32_t triangle = 0;
    double u = 0.0, v = 0.0;  ///< weights of its second and third corner
  };
  /// Calls stops(met) for what the ray meets within `far` lengths of `way`, in any order, each triangle once. Where it
  /// says true nothing farther is asked for.
  template <typename Stops>
  void visit(const glm::dvec3& from, const glm::dvec3& way, double far, const Stops& stops) const;
  /// The first of what it meets that `counts`.
  template <typename Counts>
  [[nodiscard]] std::optional<Met> first(const glm::dvec3& from, const glm::dvec3& way, double far,
                                         const Counts& counts) const;
  /// Whether anything lies between a place of the box and that place plus `way`.
  [[nodiscard]] bool blocked(const glm::dvec3& from, const glm::dvec3& way) const;

 private:
  static constexpr std::uint32_t kLeaf = 2;  ///< triangles at most
  /// Triangles are wider by this part of their sides: rounding of doubles.
  static constexpr double kEdge = 1e-12;
  struct Node {
    std::array<glm::dvec3, 2> face{};    ///< low and high
    std::uint32_t first = 0, count = 0;  ///< triangles; none: `first` is the second child, the first comes right behind
  };
  struct Corners {
    glm::dvec3 a, ab, ac;
  };
  void measure(std::span<const Triangle> triangles);
  void build(std::uint32_t first, std::uint32_t end, std::span<const glm::dvec3> middles);
  /// Moeller and Trumbore 1997.
  [[nodiscard]] std::optional<Met> meet(std::uint32_t at, const glm::dvec3& from, const glm::dvec3& way,
                                        double far) const {
    const auto& [a, ab, ac] = corners_[at];
    const auto across = glm::cross(way, ac);
    const double determinant = glm::dot(ab, across);
    if (determinant == 0.0) return std::nullopt;
    const double scale = 1.0 / determinant;
    const auto to = from - a;
    const double u = glm::dot(to, across) * scale;
    if (!(u >= -kEdge && u <= 1.0 + kEdge)) return std::nullopt;
    const auto beside = glm::cross(to, ab);
    const double v = glm::dot(way, beside) * scale;
    if (!(v >= -kEdge && u + v <= 1.0 + kEdge)) return std::nullopt;
    const double distance = glm::dot(ac, beside) * scale;
    if (!(distance > 0.0 && distance <= far)) return std::nullopt;
    return Met{distance, order_[at], u, v};
  }

  std::vector<Node> nodes_;
  std::vector<std::uint32_t> order_;  ///< triangles, leaf after leaf
  std::vector<Corners> corners_;      ///< in that order
  glm::dvec3 centre_{0.0};
  double scale_ = 1.0;
};

/// Boxes as of Kay and Kajiya 1986. Where a direction is 0 along an axis, a box holds the way there or misses it.
template <typename Stops>
void RayScene::visit(const glm::dvec3& from, const glm::dvec3& way, double far, const Stops& stops) const {
  if (nodes_.empty()) return;
  const glm::dvec3 inverse = 1.0 / way;
  const std::array<std::size_t, 3> near_face{inverse.x < 0.0, inverse.y < 0.0, inverse.z < 0.0};
  const auto larger = [](double a, double b) { return a > b ? a : b; };
  const auto smaller = [](double a, double b) { return a < b ? a : b; };
  const auto enters = [&](const Node& node) {
    const auto at = [&](std::size_t face, int axis) { return (node.face[face][axis] - from[axis]) * inverse[axis]; };
    const auto near = larger(larger(at(near_face[0], 0), at(near_face[1], 1)), larger(at(near_face[2], 2), 0.0));
    const auto end =
        smaller(smaller(at(1 - near_face[0], 0), at(1 - near_face[1], 1)), smaller(at(1 - near_face[2], 2), far));
    return near <= end ? near : std::numeric_limits<double>::infinity();
  };
  struct Waiting {
    std::uint32_t node;
    double near;
  };
  std::array<Waiting, 128> waiting;
  std::size_t count = 0;
  Waiting next{0, enters(nodes_[0])};
  while (next.near <= far && next.near < std::numeric_limits<double>::infinity()) {
    const Node& node = nodes_[next.node];
    if (node.count == 0) {
      Waiting nearer{next.node + 1, enters(nodes_[next.node + 1])}, farther{node.first, enters(nodes_[node.first])};
      if (farther.near < nearer.near) std::swap(nearer, farther);
      if (farther.near < std::numeric_limits<double>::infinity()) waiting[count++] = farther;
      next = nearer;
      if (next.near <= far && next.near < std::numeric_limits<double>::infinity()) continue;
    } else {
      for (auto at = node.first; at < node.first + node.count; ++at) {
        const auto met = meet(at, from, way, far);
        if (met && stops(*met)) far = met->distance;
      }
    }
    do {
      if (count == 0) return;
      next = waiting[--count];
    } while (!(next.near <= far));
  }
}

template <typename Counts>
std::optional<RayScene::Met> RayScene::first(const glm::dvec3& from, const glm::dvec3& way, double far,
                                             const Counts& counts) const {
  std::optional<Met> nearest;
  visit(from, way, far, [&](const Met& met) {
    if (nearest && nearest->distance <= met.distance) return false;
    if (!counts(met)) return false;
    nearest = met;
    return true;
  });
  return nearest;
}

}  // namespace radiosity::oracle
