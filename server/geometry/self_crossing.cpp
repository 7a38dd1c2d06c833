#include "server/geometry/self_crossing.h"

#include <algorithm>
#include <cstddef>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <iterator>
#include <vector>

#include "common/task.h"

namespace radiosity::scene {
namespace {

/// Gaps are wider than rounding in double, as a part of coordinates within a unit box.
constexpr double kGap = 1e-14;
/// So many pairs of boxes are looked at for each triangle, and some whatever their number is; to look at two triangles
/// themselves counts as so many. A finely divided surface takes a hundred or two for each, a disc of hundreds of
/// triangles that all meet in its middle thousands.
constexpr std::size_t kPairsEach = 1024, kPairsAtLeast = 1U << 20U, kPairsOfATest = 16;

/// A triangle, or an edge.
struct Shape {
  std::array<glm::dvec3, 3> corner;
  std::size_t count;

  [[nodiscard]] std::size_t edges() const { return count == 3 ? 3 : 1; }
  [[nodiscard]] glm::dvec3 edge(std::size_t i) const { return corner[(i + 1) % count] - corner[i]; }
  [[nodiscard]] glm::dvec3 normal() const { return glm::cross(edge(0), edge(1)); }
};

/// Whether a plane across the axis parts them.
bool apartAlong(const glm::dvec3& axis, const Shape& a, const Shape& b) {
  double low_a = 1e30, high_a = -1e30, low_b = 1e30, high_b = -1e30;
  for (std::size_t i = 0; i < a.count; ++i) {
    const double at = glm::dot(a.corner[i] - a.corner[0], axis);
    low_a = std::min(low_a, at);
    high_a = std::max(high_a, at);
  }
  for (std::size_t i = 0; i < b.count; ++i) {
    const double at = glm::dot(b.corner[i] - a.corner[0], axis);
    low_b = std::min(low_b, at);
    high_b = std::max(high_b, at);
  }
  return std::max(low_b - high_a, low_a - high_b) > kGap * glm::length(axis);
}

/// Separating axes: normals, for what lies in one plane those at right angles to edges, and products of edges.
bool areApart(const Shape& a, const Shape& b) {
  for (const auto* flat : {&a, &b}) {
    if (flat->count < 3) continue;
    const auto normal = flat->normal();
    if (apartAlong(normal, a, b)) return true;
    for (const auto* shape : {&a, &b})
      for (std::size_t i = 0; i < shape->edges(); ++i)
        if (apartAlong(glm::cross(normal, shape->edge(i)), a, b)) return true;
  }
  for (std::size_t i = 0; i < a.edges(); ++i)
    for (std::size_t k = 0; k < b.edges(); ++k)
      if (apartAlong(glm::cross(a.edge(i), b.edge(k)), a, b)) return true;
  return false;
}

/// The corners that the other does not have.
Shape restOf(const Corners& of, const Corners& other) {
  Shape shape{{}, 0};
  for (const auto& p : of)
    if (std::ranges::find(other, p) == other.end()) shape.corner[shape.count++] = p;
  return shape;
}

/// Whether all that is not shared lies on one side of a triangle's plane.
bool isBeside(const Shape& rest, const Shape& triangle) {
  const auto normal = triangle.normal();
  const double least = kGap * glm::length(normal);
  std::size_t above = 0, below = 0;
  for (std::size_t i = 0; i < rest.count; ++i) {
    const double height = glm::dot(normal, rest.corner[i] - triangle.corner[0]);
    above += height > least ? 1 : 0;
    below += height < -least ? 1 : 0;
  }
  return above == rest.count || below == rest.count;
}

/// Whether two triangles meet only where both have corners. Those that share one meet elsewhere if the edge across from
/// it of either meets the other; those that share an edge, if they lie in one plane on the same side of it.
bool meetInSharedOnly(const Corners& a, const Corners& b) {
  const Shape rest_a = restOf(a, b), rest_b = restOf(b, a);
  const Shape whole_a{{a[0], a[1], a[2]}, 3}, whole_b{{b[0], b[1], b[2]}, 3};
  if (rest_a.count != rest_b.count || rest_a.count == 0) return false;
  if (isBeside(rest_b, whole_a) || isBeside(rest_a, whole_b)) return true;
  if (rest_a.count == 3) return areApart(whole_a, whole_b);
  if (rest_a.count == 2) return areApart(rest_a, whole_b) && areApart(rest_b, whole_a);
  return glm::dot(whole_a.normal(), whole_b.normal()) > 0.0;
}

struct Box {
  glm::vec3 low, high;
  std::size_t triangle;

  [[nodiscard]] bool meets(const Box& other) const {
    return low.x <= other.high.x && other.low.x <= high.x && low.y <= other.high.y && other.low.y <= high.y &&
           low.z <= other.high.z && other.low.z <= high.z;
  }
};

Box around(std::span<const Box> boxes) {
  Box all{glm::vec3(1e30F), glm::vec3(-1e30F), 0};
  for (const auto& box : boxes) {
    all.low = glm::min(all.low, box.low);
    all.high = glm::max(all.high, box.high);
  }
  return all;
}

/// Halves the triangles again and again, and looks at those pairs that lie across from each other where the boxes of
/// the halves meet.
class CrossingSearch {
 public:
  explicit CrossingSearch(std::span<const Corners> triangles)
      : triangles_(triangles), left_(kPairsEach * triangles.size() + kPairsAtLeast) {}

  [[nodiscard]] bool areClear(std::span<Box> boxes) {
    if (boxes.size() <= kFew) {
      for (std::size_t i = 0; i < boxes.size(); ++i)
        if (!isClear(boxes[i], boxes.subspan(i + 1))) return false;
      return true;
    }
    const auto all = around(boxes);
    const glm::vec3 size = all.high - all.low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const auto half = boxes.size() / 2;
    std::nth_element(
        boxes.begin(), boxes.begin() + static_cast<std::ptrdiff_t>(half), boxes.end(),
        [axis](const Box& a, const Box& b) { return a.low[axis] + a.high[axis] < b.low[axis] + b.high[axis]; });
    const auto first = boxes.first(half), second = boxes.subspan(half);
    return areClear(first, second) && areClear(first) && areClear(second);
  }

 private:
  static constexpr std::size_t kFew = 8;

  [[nodiscard]] bool areClear(std::span<const Box> first, std::span<const Box> second) {
    std::vector<Box> near_first, near_second;
    const auto meets = [](const Box& other) { return [&other](const Box& box) { return box.meets(other); }; };
    std::ranges::copy_if(first, std::back_inserter(near_first), meets(around(second)));
    std::ranges::copy_if(second, std::back_inserter(near_second), meets(around(near_first)));
    return std::ranges::all_of(near_first, [&](const Box& box) { return isClear(box, near_second); });
  }

  /// Of all others. So it counts as not when too much was looked at.
  [[nodiscard]] bool isClear(const Box& box, std::span<const Box> others) {
    if (left_ < others.size()) return false;
    left_ -= others.size();
    for (const auto& other : others) {
      interruptionPoint();
      if (!box.meets(other)) continue;
      if (left_ < kPairsOfATest) return false;
      left_ -= kPairsOfATest;
      if (!meetInSharedOnly(triangles_[box.triangle], triangles_[other.triangle])) return false;
    }
    return true;
  }

  std::span<const Corners> triangles_;
  std::size_t left_;  ///< pairs that may still be looked at
};

}  // namespace

bool keepsClearOfItself(std::span<const Corners> triangles) {
  std::vector<Box> boxes;
  boxes.reserve(triangles.size());
  for (const auto& [a, b, c] : triangles)
    boxes.push_back({glm::min(glm::min(a, b), c), glm::max(glm::max(a, b), c), boxes.size()});
  return CrossingSearch(triangles).areClear(boxes);
}

}  // namespace radiosity::scene
