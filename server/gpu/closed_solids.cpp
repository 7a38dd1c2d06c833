#include "server/gpu/closed_solids.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numeric>
#include <unordered_map>

#include "server/gpu/self_crossing.h"

namespace radiosity::gpu {
namespace {

struct PositionHash {
  std::size_t operator()(const std::array<std::uint32_t, 3>& bits) const {
    std::uint64_t hash = 0x9E3779B97F4A7C15U;
    for (const auto word : bits) hash = (hash ^ word) * 0xFF51AFD7ED558CCDU ^ hash >> 29U;
    return hash;
  }
};

/// The same number for corners at the same place.
std::vector<std::uint32_t> weld(const scene::PatchScene& patches) {
  std::unordered_map<std::array<std::uint32_t, 3>, std::uint32_t, PositionHash> known;
  std::vector<std::uint32_t> place(patches.vertices.size());
  for (std::size_t i = 0; i < place.size(); ++i) {
    const auto position = patches.vertices[i].position + 0.0F;  // -0 becomes 0
    std::array<std::uint32_t, 3> bits{};
    std::memcpy(bits.data(), &position, sizeof(bits));
    place[i] = known.emplace(bits, static_cast<std::uint32_t>(known.size())).first->second;
  }
  return place;
}

class UnionFind {
 public:
  explicit UnionFind(std::size_t count) : parent_(count) { std::iota(parent_.begin(), parent_.end(), 0U); }
  std::uint32_t find(std::uint32_t item) {
    while (parent_[item] != item) item = parent_[item] = parent_[parent_[item]];
    return item;
  }
  void join(std::uint32_t a, std::uint32_t b) { parent_[find(a)] = find(b); }

 private:
  std::vector<std::uint32_t> parent_;
};

Corners cornersOf(const scene::PatchScene& patches, std::uint32_t triangle) {
  const auto corner = [&](std::size_t c) {
    return patches.vertices[patches.indices[std::size_t{3} * triangle + c]].position;
  };
  return {corner(0), corner(1), corner(2)};
}

struct Edge {
  std::uint64_t key;  ///< its two places, the smaller first
  std::uint32_t triangle;
  bool forward;  ///< from the smaller to the larger
};

std::vector<Edge> sortedEdges(const scene::PatchScene& patches) {
  const auto place = weld(patches);
  std::vector<Edge> edges;
  edges.reserve(patches.indices.size());
  for (std::size_t i = 0; i < patches.indices.size(); ++i) {
    const auto triangle = i / 3;
    const std::uint64_t from = place[patches.indices[i]];
    const std::uint64_t to = place[patches.indices[3 * triangle + (i + 1) % 3]];
    edges.push_back({std::min(from, to) << 32U | std::max(from, to), static_cast<std::uint32_t>(triangle), from < to});
  }
  std::sort(edges.begin(), edges.end(),
            [](const Edge& a, const Edge& b) { return a.key != b.key ? a.key < b.key : a.triangle < b.triangle; });
  return edges;
}

/// By triangle: one of those it is connected with, the same for all of them; kNone where they have an open edge, can be
/// seen through, or enclose no positive volume.
std::vector<std::uint32_t> closedParts(const scene::PatchScene& patches) {
  const auto triangles = patches.indices.size() / 3;
  UnionFind parts(triangles);
  std::vector<bool> open(triangles, false);
  const auto edges = sortedEdges(patches);
  for (std::size_t first = 0, last = 0; first < edges.size(); first = last) {
    while (last < edges.size() && edges[last].key == edges[first].key) ++last;
    const bool closed = last - first == 2 && edges[first].forward != edges[first + 1].forward;
    for (auto i = first; i < last; ++i) {
      parts.join(edges[i].triangle, edges[first].triangle);
      if (!closed) open[edges[i].triangle] = true;
    }
  }
  std::vector<bool> part_open(triangles, false);
  std::vector<double> volume(triangles, 0.0);
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const auto part = parts.find(i);
    const bool see_through = patches.surfaces[patches.triangle_surface[i]].see_through;
    if (open[i] || see_through) part_open[part] = true;
    const auto [a, b, c] = cornersOf(patches, i);
    volume[part] += glm::dot(glm::dvec3(a), glm::cross(glm::dvec3(b), glm::dvec3(c)));
  }
  std::vector<std::uint32_t> part_of(triangles, scene::kNone);
  for (std::uint32_t i = 0; i < triangles; ++i) {
    const auto part = parts.find(i);
    if (!part_open[part] && volume[part] > 0.0) part_of[i] = part;
  }
  return part_of;
}

}  // namespace

/// A connected surface that keeps clear of itself has two sides, and where the volume is positive its backs are within:
/// no two volumes of it overlap, and none is turned inside out.
ClosedSolids findClosedSolids(const scene::PatchScene& patches) {
  const auto part_of = closedParts(patches);
  std::vector<std::uint32_t> order;  // part after part, in the order of their first triangles
  std::vector<std::uint32_t> first_of(part_of.size(), scene::kNone);
  for (std::uint32_t i = 0; i < part_of.size(); ++i) {
    if (part_of[i] == scene::kNone) continue;
    if (first_of[part_of[i]] == scene::kNone) first_of[part_of[i]] = i;
    order.push_back(i);
  }
  const auto first = [&](std::uint32_t triangle) { return first_of[part_of[triangle]]; };
  std::ranges::stable_sort(order, {}, first);

  ClosedSolids solids;
  solids.solid_of.assign(part_of.size(), scene::kNone);
  std::vector<Corners> triangles;
  for (auto begin = order.begin(), end = begin; begin != order.end(); begin = end) {
    end = std::find_if(begin, order.end(), [&](std::uint32_t i) { return first(i) != first(*begin); });
    triangles.clear();
    for (auto i = begin; i != end; ++i) triangles.push_back(cornersOf(patches, *i));
    if (!keepsClearOfItself(triangles)) continue;
    ClosedSolids::Bounds bounds{glm::vec3(1e30F), glm::vec3(-1e30F)};
    for (const auto& corners : triangles) {
      for (const auto& position : corners) {
        bounds.low = glm::min(bounds.low, position);
        bounds.high = glm::max(bounds.high, position);
      }
    }
    for (auto i = begin; i != end; ++i) solids.solid_of[*i] = static_cast<std::uint32_t>(solids.bounds.size());
    solids.bounds.push_back(bounds);
  }
  return solids;
}

}  // namespace radiosity::gpu
