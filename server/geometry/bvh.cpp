#include "server/geometry/bvh.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <numeric>
#include <utility>

#include "common/give_back.h"
#include "common/task.h"
#include "server/geometry/bounds.h"
#include "server/geometry/triangle_hit.h"

namespace radiosity::scene {
namespace {

constexpr std::uint32_t kLeafSize = 4;
constexpr int kBins = 16;
constexpr std::size_t kStackDepth = 128;

float halfArea(const Bounds& box) {
  if (box.empty()) return 0.0F;
  const glm::vec3 d = box.max - box.min;
  return d.x * d.y + d.y * d.z + d.z * d.x;
}

/// A ray for the slab test, in single precision. `origin` is grown both ways by more than what rounding moves a
/// box's sides and where the ray meets them, for coordinates and ways within a few unit boxes: no box that the exact
/// ray meets is missed, and of the others triangles decide.
struct SlabRay {
  static constexpr float kGrowth = 2e-6F;
  glm::vec3 before, behind, inverse;
  float t_min, t_max;

  SlabRay(const glm::dvec3& origin, const glm::dvec3& direction, double from, double to)
      : before(glm::vec3(origin) + kGrowth),
        behind(glm::vec3(origin) - kGrowth),
        t_min(static_cast<float>(from) - kGrowth),
        t_max(static_cast<float>(to) + kGrowth) {
    for (int axis = 0; axis < 3; ++axis) {  // a zero component would make 0 x infinity
      const double component = std::abs(direction[axis]) > 1e-30 ? direction[axis] : 1e-30;
      inverse[axis] = static_cast<float>(1.0 / component);
    }
  }

  [[nodiscard]] bool meets(const glm::vec3& low, const glm::vec3& high) const {
    return entry(low, high) < std::numeric_limits<float>::infinity();
  }
  /// Where the ray comes in; infinity: it does not.
  [[nodiscard]] float entry(const glm::vec3& low, const glm::vec3& high) const {
    float near = t_min, far = t_max;
    for (int axis = 0; axis < 3; ++axis) {
      const float one = (low[axis] - before[axis]) * inverse[axis], other = (high[axis] - behind[axis]) * inverse[axis];
      near = std::max(near, std::min(one, other));
      far = std::min(far, std::max(one, other));
    }
    return near <= far ? near : std::numeric_limits<float>::infinity();
  }
};

/// What lies outside of a turned box by more than this, as seen along the axes of the scene, is outside of it however
/// its corners are rounded (unit box).
constexpr float kFarApart = 1e-5F;

/// Separating axes of a triangle and a box (Akenine-Moller 2001): box faces, triangle plane, nine edge products.
bool touchesBox(const Bvh::Triangle& triangle, const glm::vec3& low, const glm::vec3& high) {
  const glm::vec3 centre = 0.5F * (low + high);
  const glm::vec3 half = 0.5F * (high - low);
  const std::array<glm::vec3, 3> v{triangle[0] - centre, triangle[1] - centre, triangle[2] - centre};
  const auto isApart = [](float a, float b, float c, float reach) {
    return std::min({a, b, c}) > reach || std::max({a, b, c}) < -reach;
  };
  for (int axis = 0; axis < 3; ++axis)
    if (isApart(v[0][axis], v[1][axis], v[2][axis], half[axis])) return false;
  const std::array<glm::vec3, 3> edges{v[1] - v[0], v[2] - v[1], v[0] - v[2]};
  const auto normal = glm::cross(edges[0], edges[1]);
  const float reach = glm::dot(half, glm::abs(normal));
  if (isApart(glm::dot(v[0], normal), glm::dot(v[1], normal), glm::dot(v[2], normal), reach)) return false;
  for (const auto& edge : edges)
    for (int axis = 0; axis < 3; ++axis) {  // the product of the edge and the axis has two components
      const int one = (axis + 1) % 3, other = (axis + 2) % 3;
      const auto along = [&](const glm::vec3& p) { return p[one] * edge[other] - p[other] * edge[one]; };
      const float width = half[one] * std::abs(edge[other]) + half[other] * std::abs(edge[one]);
      if (isApart(along(v[0]), along(v[1]), along(v[2]), width)) return false;
    }
  return true;
}

}  // namespace

Bvh::Bvh(std::vector<Triangle> triangles) : triangles_(std::move(triangles)), order_(triangles_.size()) {
  if (triangles_.empty()) return;
  std::iota(order_.begin(), order_.end(), 0U);
  centres_.reserve(triangles_.size());
  for (const auto& t : triangles_) centres_.push_back((t[0] + t[1] + t[2]) / 3.0F);
  build();
  giveBack(centres_);
  std::vector<Triangle> ordered;  // leaf after leaf, as rays ask for them
  ordered.reserve(triangles_.size());
  for (const auto index : order_) ordered.push_back(triangles_[index]);
  triangles_ = std::move(ordered);
}

void Bvh::build() {
  nodes_.push_back({{}, {}, 0, static_cast<std::uint32_t>(triangles_.size())});
  struct Task {
    std::uint32_t node, depth;
  };
  std::vector<Task> pending{{0, 0}};
  while (!pending.empty()) {
    interruptionPoint();
    const Task task = pending.back();
    pending.pop_back();
    const std::uint32_t first = nodes_[task.node].first, count = nodes_[task.node].count;
    Bounds box;
    for (std::uint32_t i = first; i < first + count; ++i)
      for (const auto& p : triangles_[order_[i]]) box.add(p);
    nodes_[task.node].min = box.min;
    nodes_[task.node].max = box.max;
    if (count <= kLeafSize || task.depth + 2 >= kStackDepth / 2) continue;
    const std::uint32_t left = split(first, count);
    const auto child = static_cast<std::uint32_t>(nodes_.size());
    nodes_[task.node].first = child;
    nodes_[task.node].count = 0;
    nodes_.push_back({{}, {}, first, left});
    nodes_.push_back({{}, {}, first + left, count - left});
    pending.push_back({child, task.depth + 1});
    pending.push_back({child + 1, task.depth + 1});
  }
  nodes_.shrink_to_fit();
}

/// Reorders order_[first, first + count) and returns how many go left; never all or none.
std::uint32_t Bvh::split(std::uint32_t first, std::uint32_t count) {
  Bounds spread;
  for (std::uint32_t i = first; i < first + count; ++i) spread.add(centres_[order_[i]]);
  const glm::vec3 extent = spread.max - spread.min;
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : (extent.y >= extent.z ? 1 : 2);
  if (!(extent[axis] > 0.0F)) return count / 2;
  const auto binOf = [&](std::uint32_t t) {
    const float where = (centres_[t][axis] - spread.min[axis]) / extent[axis];
    return std::min(kBins - 1, static_cast<int>(where * static_cast<float>(kBins)));
  };
  std::array<Bounds, kBins> boxes;
  std::array<std::uint32_t, kBins> counts{};
  for (std::uint32_t i = first; i < first + count; ++i) {
    const auto bin = static_cast<std::size_t>(binOf(order_[i]));
    ++counts[bin];
    for (const auto& p : triangles_[order_[i]]) boxes[bin].add(p);
  }
  std::array<float, kBins> right_cost{};
  Bounds right;
  std::uint32_t right_count = 0;
  for (std::size_t bin = kBins - 1; bin > 0; --bin) {
    right.add(boxes[bin]);
    right_count += counts[bin];
    right_cost[bin] = halfArea(right) * static_cast<float>(right_count);
  }
  Bounds left;
  std::uint32_t left_count = 0;
  int best = 0;
  float best_cost = std::numeric_limits<float>::infinity();
  for (std::size_t bin = 0; bin + 1 < kBins; ++bin) {
    left.add(boxes[bin]);
    left_count += counts[bin];
    const float cost = halfArea(left) * static_cast<float>(left_count) + right_cost[bin + 1];
    if (left_count > 0 && left_count < count && cost < best_cost) {
      best_cost = cost;
      best = static_cast<int>(bin);
    }
  }
  const auto begin = order_.begin() + first;
  const auto middle = std::partition(begin, begin + count, [&](std::uint32_t t) { return binOf(t) <= best; });
  const auto size = static_cast<std::uint32_t>(middle - begin);
  return size == 0 || size == count ? count / 2 : size;
}

void Bvh::collectHits(const glm::dvec3& origin, const glm::dvec3& direction, double t_min, double t_max,
                      std::vector<RayHit>& hits) const {
  if (triangles_.empty()) return;
  const SlabRay ray(origin, direction, t_min, t_max);
  std::array<std::uint32_t, kStackDepth> stack;
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = nodes_[stack[--depth]];
    if (!ray.meets(node.min, node.max)) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = node.first + 1;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      RayHit hit{0.0, order_[i], false};
      if (meetsTriangle(triangles_[i], origin, direction, hit) && hit.t > t_min && hit.t < t_max) hits.push_back(hit);
    }
  }
}

std::vector<std::uint32_t> Bvh::leastTags(std::span<const std::uint32_t> tags) const {
  std::vector<std::uint32_t> least(nodes_.size(), std::numeric_limits<std::uint32_t>::max());
  for (auto n = nodes_.size(); n-- > 0;) {  // children follow
    const Node& node = nodes_[n];
    if (node.count == 0) least[n] = std::min(least[node.first], least[node.first + 1]);
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) least[n] = std::min(least[n], tags[order_[i]]);
  }
  return least;
}

std::optional<RayHit> Bvh::leastHit(const glm::dvec3& origin, const glm::dvec3& direction, double t_min, double t_max,
                                    std::span<const std::uint32_t> tags, std::span<const std::uint32_t> least,
                                    std::uint32_t end, const std::function<bool(const RayHit&)>& counts) const {
  if (triangles_.empty()) return std::nullopt;
  const SlabRay ray(origin, direction, t_min, t_max);
  // Best first: boxes of many triangles in one place all hold it, also those of halves of squares that it is not in.
  struct Waiting {
    std::uint32_t least, node;
  };
  const auto isLater = [](const Waiting& a, const Waiting& b) {
    return a.least != b.least ? a.least > b.least : a.node > b.node;
  };
  std::vector<Waiting> waiting;
  const auto wait = [&](std::uint32_t node) {
    if (least[node] > end || !ray.meets(nodes_[node].min, nodes_[node].max)) return;
    waiting.push_back({least[node], node});
    std::ranges::push_heap(waiting, isLater);
  };
  wait(0);
  std::optional<RayHit> found;
  std::uint32_t found_in = 0;  // collectHits() comes to later parts of the list first
  const auto isEarlier = [&](std::uint32_t tag, std::uint32_t part) {
    return found ? tag < tags[found->triangle] || (tag == tags[found->triangle] && part > found_in) : tag < end;
  };
  while (!waiting.empty()) {
    std::ranges::pop_heap(waiting, isLater);
    const auto next = waiting.back();
    waiting.pop_back();
    if (found ? next.least > tags[found->triangle] : next.least >= end) break;
    const Node& node = nodes_[next.node];
    if (node.count == 0) {
      wait(node.first);
      wait(node.first + 1);
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      RayHit hit{0.0, order_[i], false};
      if (!isEarlier(tags[hit.triangle], node.first) || !meetsTriangle(triangles_[i], origin, direction, hit)) continue;
      if (!(hit.t > t_min && hit.t < t_max) || !counts(hit)) continue;
      found = hit;
      found_in = node.first;
    }
  }
  return found;
}

/// A ray from the middle of the box, past what is larger by half the box on all sides. Triangles seen edge-on count as
/// turned either way.
bool Bvh::mayMeetBack(const glm::vec3& box_min, const glm::vec3& box_max, const glm::dvec3& direction,
                      double t_max) const {
  if (triangles_.empty()) return false;
  constexpr double kEdgeOn = 1e-6;
  const SlabRay ray(0.5 * (glm::dvec3(box_min) + glm::dvec3(box_max)), direction, 0.0, t_max);
  const glm::vec3 half = 0.5F * (box_max - box_min) + SlabRay::kGrowth;
  const double length = glm::length(direction);
  std::array<std::uint32_t, kStackDepth> stack;
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    const Node& node = nodes_[stack[--depth]];
    if (!ray.meets(node.min - half, node.max + half)) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = node.first + 1;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      const auto& [a, b, c] = triangles_[i];
      const glm::dvec3 normal = glm::cross(glm::dvec3(b) - glm::dvec3(a), glm::dvec3(c) - glm::dvec3(a));
      if (glm::dot(direction, normal) < -kEdgeOn * length * glm::length(normal)) continue;
      if (ray.meets(glm::min(glm::min(a, b), c) - half, glm::max(glm::max(a, b), c) + half)) return true;
    }
  }
  return false;
}

/// The hit with the least t, or any where `kAny`. Nearer children first.
template <bool kAny>
std::optional<RayHit> Bvh::findHit(const glm::dvec3& origin, const glm::dvec3& direction, double t_min,
                                   double t_max) const {
  if (triangles_.empty()) return std::nullopt;
  SlabRay ray(origin, direction, t_min, t_max);
  struct Task {
    std::uint32_t node;
    float entry;
  };
  std::array<Task, kStackDepth> stack;
  std::size_t depth = 0;
  stack[depth++] = {0, ray.entry(nodes_[0].min, nodes_[0].max)};
  std::optional<RayHit> found;
  while (depth > 0) {
    const Task task = stack[--depth];
    if (task.entry > ray.t_max) continue;
    const Node& node = nodes_[task.node];
    if (node.count == 0) {
      const Task left{node.first, ray.entry(nodes_[node.first].min, nodes_[node.first].max)};
      const Task right{node.first + 1, ray.entry(nodes_[node.first + 1].min, nodes_[node.first + 1].max)};
      const bool left_first = left.entry <= right.entry;
      const Task &near = left_first ? left : right, &far = left_first ? right : left;
      if (far.entry <= ray.t_max) stack[depth++] = far;
      if (near.entry <= ray.t_max) stack[depth++] = near;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      RayHit hit{0.0, order_[i], false};
      if (!meetsTriangle(triangles_[i], origin, direction, hit) || !(hit.t > t_min && hit.t < t_max)) continue;
      if constexpr (kAny) return hit;
      t_max = hit.t;
      ray.t_max = static_cast<float>(t_max) + SlabRay::kGrowth;
      found = hit;
    }
  }
  return found;
}

std::optional<RayHit> Bvh::nearestHit(const glm::dvec3& origin, const glm::dvec3& direction, double t_min,
                                      double t_max) const {
  return findHit<false>(origin, direction, t_min, t_max);
}

bool Bvh::meets(const glm::dvec3& origin, const glm::dvec3& direction, double t_min, double t_max) const {
  return findHit<true>(origin, direction, t_min, t_max).has_value();
}

/// Whether the test holds for any triangle, as triangles_ has them, of the tree's leaves that reach into the box; or
/// that is not known after so many looks.
template <typename Test>
bool Bvh::anyTriangle(const glm::vec3& box_min, const glm::vec3& box_max, Test test, std::size_t looks) const {
  if (triangles_.empty()) return false;
  std::array<std::uint32_t, kStackDepth> stack;
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    if (looks-- == 0) return true;
    const Node& node = nodes_[stack[--depth]];
    bool apart = false;
    for (int axis = 0; axis < 3; ++axis)
      apart = apart || node.min[axis] > box_max[axis] || node.max[axis] < box_min[axis];
    if (apart) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = node.first + 1;
      continue;
    }
    looks -= std::min<std::size_t>(looks, node.count);
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i)
      if (test(i)) return true;
  }
  return false;
}

bool Bvh::touches(const glm::vec3& box_min, const glm::vec3& box_max, std::span<const std::uint32_t> tags,
                  std::uint32_t ignored_tag, std::size_t looks) const {
  const auto touchesIt = [&](std::uint32_t i) {
    return tags[order_[i]] != ignored_tag && touchesBox(triangles_[i], box_min, box_max);
  };
  return anyTriangle(box_min, box_max, touchesIt, looks);
}

bool Bvh::risesAbove(const glm::vec3& normal, float height) const {
  if (triangles_.empty()) return false;
  constexpr int kMostNodes = 64;  // of what lies in the plane itself, and is tilted, every box rises above it
  int looked = 0;
  std::array<std::uint32_t, kStackDepth> stack;
  std::size_t depth = 0;
  stack[depth++] = 0;
  while (depth > 0) {
    if (++looked > kMostNodes) return true;
    const Node& node = nodes_[stack[--depth]];
    if (glm::dot(normal, glm::mix(node.min, node.max, glm::greaterThan(normal, glm::vec3(0.0F)))) <= height) continue;
    if (node.count == 0) {
      stack[depth++] = node.first;
      stack[depth++] = node.first + 1;
      continue;
    }
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i) {
      for (const auto& corner : triangles_[i])
        if (glm::dot(normal, corner) > height) return true;
    }
  }
  return false;
}

bool Bvh::holdsOne(const glm::vec3& box_min, const glm::vec3& box_max) const {
  return anyTriangle(box_min, box_max, [&](std::uint32_t i) {
    return std::ranges::all_of(triangles_[i], [&](const glm::vec3& corner) {
      return glm::all(glm::lessThanEqual(box_min, corner)) && glm::all(glm::lessThanEqual(corner, box_max));
    });
  });
}

bool Bvh::collectNear(const glm::vec3& box_min, const glm::vec3& box_max, std::size_t most,
                      std::vector<std::uint32_t>& triangles) const {
  const auto room = triangles.size() + most;
  return !anyNear(box_min, box_max, [&](std::uint32_t triangle) {
    triangles.push_back(triangle);
    return triangles.size() > room;
  });
}

bool Bvh::anyNear(const glm::vec3& box_min, const glm::vec3& box_max,
                  const std::function<bool(std::uint32_t triangle)>& is_it) const {
  return anyTriangle(box_min, box_max, [&](std::uint32_t i) {
    const auto& [a, b, c] = triangles_[i];
    const auto low = glm::min(glm::min(a, b), c), high = glm::max(glm::max(a, b), c);
    return glm::all(glm::lessThanEqual(low, box_max)) && glm::all(glm::lessThanEqual(box_min, high)) &&
           is_it(order_[i]);
  });
}

/// Whether the test holds for any triangle that touches the box; it gets the triangle in the axes of the box.
template <typename Test>
bool Bvh::anyTouching(const OrientedBox& box, Test test, std::size_t looks) const {
  glm::vec3 reach(0.0F);
  for (int axis = 0; axis < 3; ++axis) reach += box.half[axis] * glm::abs(box.axes[static_cast<std::size_t>(axis)]);
  const auto low = box.centre - reach - kFarApart, high = box.centre + reach + kFarApart;
  const auto touchesIt = [&](std::uint32_t i) {
    const auto& [a, b, c] = triangles_[i];
    for (int axis = 0; axis < 3; ++axis)
      if (std::min({a[axis], b[axis], c[axis]}) > high[axis] || std::max({a[axis], b[axis], c[axis]}) < low[axis])
        return false;
    Triangle local;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec3 p = triangles_[i][k] - box.centre;
      local[k] = {glm::dot(p, box.axes[0]), glm::dot(p, box.axes[1]), glm::dot(p, box.axes[2])};
    }
    return test(order_[i], local) && touchesBox(local, -box.half, box.half);
  };
  return anyTriangle(box.centre - reach, box.centre + reach, touchesIt, looks);
}

bool Bvh::touches(const OrientedBox& box, std::span<const std::uint32_t> tags, std::uint32_t ignored_tag,
                  std::size_t looks) const {
  const auto counts = [&](std::uint32_t triangle, const Triangle&) { return tags[triangle] != ignored_tag; };
  return anyTouching(box, counts, looks);
}

bool Bvh::hoversIn(const OrientedBox& box, std::span<const std::uint32_t> tags, std::uint32_t ignored_tag,
                   std::size_t looks) const {
  const auto hovers = [&](std::uint32_t triangle, const Triangle& local) {
    return tags[triangle] != ignored_tag && std::min({local[0].z, local[1].z, local[2].z}) > -box.half.z;
  };
  return anyTouching(box, hovers, looks);
}

}  // namespace radiosity::scene
