#include "server/scene/shading/mesh_parts.h"

#include <algorithm>
#include <numeric>
#include <tuple>
#include <utility>

#include "common/task.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {
namespace {

/// By corner (3 x triangle + k): a number that corners in one place of one instance share.
std::vector<std::uint32_t> weldCorners(std::span<const Bvh::Triangle> triangles,
                                       std::span<const std::uint32_t> group_of,
                                       std::span<const std::uint32_t> instance_of) {
  std::vector<std::uint32_t> order(3 * triangles.size()), number(order.size());
  std::iota(order.begin(), order.end(), 0U);
  const auto key = [&](std::uint32_t corner) {
    const auto& c = triangles[corner / 3][corner % 3];
    return std::tuple(instance_of[group_of[corner / 3]], c.x, c.y, c.z);
  };
  std::ranges::sort(order, {}, key);
  std::uint32_t next = 0;
  for (std::size_t i = 0; i < order.size(); ++i) {
    if (i > 0 && key(order[i]) != key(order[i - 1])) ++next;
    number[order[i]] = next;
  }
  return number;
}

/// Disjoint sets, with path halving (Tarjan and van Leeuwen 1984).
class Sets {
 public:
  explicit Sets(std::size_t count) : above_(count) { std::iota(above_.begin(), above_.end(), 0U); }
  std::uint32_t top(std::uint32_t i) {
    while (above_[i] != i) i = above_[i] = above_[above_[i]];
    return i;
  }
  void join(std::uint32_t a, std::uint32_t b) { above_[top(a)] = top(b); }

 private:
  std::vector<std::uint32_t> above_;
};

}  // namespace

MeshParts findMeshParts(std::span<const Bvh::Triangle> triangles, std::span<const std::uint32_t> group_of,
                        std::span<const std::uint32_t> instance_of) {
  const auto corner = weldCorners(triangles, group_of, instance_of);
  Sets sets(corner.size());
  for (std::size_t i = 0; i < corner.size(); ++i) sets.join(corner[i], corner[i - i % 3]);
  std::vector<std::uint32_t> part_of_top(corner.size(), kNone);
  MeshParts parts{std::vector<std::uint32_t>(instance_of.size(), kNone), {}};
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    auto& part = part_of_top[sets.top(corner[3 * t])];
    if (part == kNone) {
      part = static_cast<std::uint32_t>(parts.closed.size());
      parts.closed.push_back(true);
    }
    parts.of_group[group_of[t]] = part;
  }
  std::vector<std::pair<std::uint64_t, std::uint32_t>> edges;  // both ends, and the part
  for (std::size_t i = 0; i < corner.size(); ++i) {
    const auto [low, high] = std::minmax(corner[i], corner[i - i % 3 + (i + 1) % 3]);
    edges.emplace_back(std::uint64_t{low} << 32U | high, parts.of_group[group_of[i / 3]]);
  }
  std::ranges::sort(edges);
  for (std::size_t i = 0, end = 0; i < edges.size(); i = end) {
    interruptionPoint();
    while (end < edges.size() && edges[end].first == edges[i].first) ++end;
    if ((end - i) % 2 != 0) parts.closed[edges[i].second] = false;
  }
  return parts;
}

}  // namespace radiosity::scene
