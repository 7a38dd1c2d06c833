#include "server/scene/burial/solid_finder.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <span>
#include <tuple>
#include <unordered_map>

#include "common/task.h"
#include "common/union_find.h"
#include "server/geometry/self_crossing.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {
namespace {

struct PositionHash {
  std::size_t operator()(const std::array<std::uint32_t, 3>& bits) const {
    std::uint64_t hash = 0x9E3779B97F4A7C15U;
    for (const auto word : bits) hash = (hash ^ word) * 0xFF51AFD7ED558CCDU ^ hash >> 29U;
    return hash;
  }
};

/// The same number for corners at the same place.
std::vector<std::uint32_t> weld(const PatchScene& patches) {
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

Corners cornersOf(const PatchScene& patches, std::uint32_t triangle) {
  const auto corner = [&](std::size_t c) {
    return patches.vertices[patches.indices[std::size_t{3} * triangle + c]].position;
  };
  return {corner(0), corner(1), corner(2)};
}

struct Edge {
  std::uint64_t key;  ///< its two places, the smaller first
  std::uint32_t instance, triangle;
  bool forward;  ///< from the smaller to the larger
};

std::vector<Edge> sortedEdges(const PatchScene& patches) {
  const auto place = weld(patches);
  std::vector<Edge> edges;
  edges.reserve(patches.indices.size());
  for (std::size_t i = 0; i < patches.indices.size(); ++i) {
    const auto triangle = i / 3;
    const std::uint64_t from = place[patches.indices[i]];
    const std::uint64_t to = place[patches.indices[3 * triangle + (i + 1) % 3]];
    edges.push_back({std::min(from, to) << 32U | std::max(from, to),
                     patches.surfaces[patches.triangle_surface[triangle]].instance,
                     static_cast<std::uint32_t>(triangle), from < to});
  }
  std::sort(edges.begin(), edges.end(), [](const Edge& a, const Edge& b) {
    return std::tie(a.key, a.instance, a.triangle) < std::tie(b.key, b.instance, b.triangle);
  });
  return edges;
}

/// Of triangles connected with each other, by one of them.
struct Part {
  ClosedSolids::Bounds bounds{glm::vec3(1e30F), glm::vec3(-1e30F)};
  bool open = false;    ///< an edge is, or one can see through it
  double volume = 0.0;  ///< six times that, about the middle of its bounds
};

struct Parts {
  std::vector<std::uint32_t> of;  ///< by triangle
  std::vector<Part> all;          ///< by triangle: used where it is its own
};

/// Those of some edges in one place, sorted by instance, that are not an instance's only two, running opposite ways.
/// Solids may touch along their edges, all the more where a floor is cut along what stands on it: each has its own two
/// triangles there. Joins these.
std::vector<Edge> withoutPairs(std::span<const Edge> edges, UnionFind& joined) {
  std::vector<Edge> others;
  for (std::size_t first = 0, last = 0; first < edges.size(); first = last) {
    while (last < edges.size() && edges[last].instance == edges[first].instance) ++last;
    if (last - first == 2 && edges[first].forward != edges[first + 1].forward) {
      joined.join(edges[first].triangle, edges[first + 1].triangle);
    } else {
      others.insert(others.end(), edges.begin() + static_cast<std::ptrdiff_t>(first),
                    edges.begin() + static_cast<std::ptrdiff_t>(last));
    }
  }
  return others;
}

Parts connectedParts(const PatchScene& patches) {
  const auto triangles = patches.indices.size() / 3;
  UnionFind joined(triangles);
  Parts parts{std::vector<std::uint32_t>(triangles), std::vector<Part>(triangles)};
  std::vector<bool> open(triangles, false);
  const auto edges = sortedEdges(patches);
  for (std::size_t first = 0, last = 0; first < edges.size(); first = last) {
    interruptionPoint();
    while (last < edges.size() && edges[last].key == edges[first].key) ++last;
    const auto others = withoutPairs(std::span(edges).subspan(first, last - first), joined);
    const bool closed = others.size() == 2 && others[0].forward != others[1].forward;
    for (const auto& edge : others) {
      joined.join(edge.triangle, others.front().triangle);
      if (!closed) open[edge.triangle] = true;
    }
  }
  for (std::uint32_t i = 0; i < triangles; ++i) {
    auto& part = parts.all[parts.of[i] = joined.find(i)];
    part.open = part.open || open[i] || patches.surfaces[patches.triangle_surface[i]].see_through;
    for (const auto& corner : cornersOf(patches, i)) {
      part.bounds.low = glm::min(part.bounds.low, corner);
      part.bounds.high = glm::max(part.bounds.high, corner);
    }
  }
  for (std::uint32_t i = 0; i < triangles; ++i) {
    auto& part = parts.all[parts.of[i]];
    const auto middle = 0.5 * (glm::dvec3(part.bounds.low) + glm::dvec3(part.bounds.high));
    const auto [a, b, c] = cornersOf(patches, i);
    part.volume += glm::dot(glm::dvec3(a) - middle, glm::cross(glm::dvec3(b) - middle, glm::dvec3(c) - middle));
  }
  return parts;
}

/// Of its bounds: more than rounding makes of what is flat.
bool holdsSomething(const Part& part) {
  constexpr double kLeast = 1e-3;
  const glm::dvec3 size(part.bounds.high - part.bounds.low);
  return part.volume > kLeast * size.x * size.y * size.z;
}

}  // namespace

/// A connected surface that keeps clear of itself has two sides, and where the volume is positive its backs are within:
/// no two volumes of it overlap, and none is turned inside out.
ClosedSolids findClosedSolids(const PatchScene& patches) {
  const auto parts = connectedParts(patches);
  std::vector<std::uint32_t> order;  // part after part, in the order of their first triangles
  std::vector<std::uint32_t> first_of(parts.of.size(), kNone);
  for (std::uint32_t i = 0; i < parts.of.size(); ++i) {
    if (first_of[parts.of[i]] == kNone) first_of[parts.of[i]] = i;
    order.push_back(i);
  }
  const auto first = [&](std::uint32_t triangle) { return first_of[parts.of[triangle]]; };
  std::ranges::stable_sort(order, {}, first);

  ClosedSolids solids;
  solids.solid_of.assign(parts.of.size(), kNone);
  solids.hollow_of = solids.solid_of;
  const auto add = [&](std::span<const std::uint32_t> part, const ClosedSolids::Bounds& box,
                       std::vector<std::uint32_t>& number, std::vector<ClosedSolids::Bounds>& bounds) {
    for (const auto i : part) number[i] = static_cast<std::uint32_t>(bounds.size());
    bounds.push_back(box);
  };
  std::vector<Corners> triangles;
  for (auto begin = order.begin(), end = begin; begin != order.end(); begin = end) {
    interruptionPoint();
    const auto& part = parts.all[parts.of[*begin]];
    end = std::find_if(begin, order.end(), [&](std::uint32_t i) { return first(i) != first(*begin); });
    triangles.clear();
    for (auto i = begin; i != end && !part.open && part.volume > 0.0; ++i) triangles.push_back(cornersOf(patches, *i));
    if (!triangles.empty() && keepsClearOfItself(triangles)) {
      add({begin, end}, part.bounds, solids.solid_of, solids.bounds);
    } else if (holdsSomething(part)) {
      add({begin, end}, part.bounds, solids.hollow_of, solids.hollows);
    }
  }
  return solids;
}

}  // namespace radiosity::scene
