#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/task.h"
#include "server/scene/charts/charts.h"

namespace radiosity::scene {
namespace {

constexpr double kSameSeamNormal = 0.9999;  // 0.8 degrees, as coarse as normals of 8 bits are
constexpr double kSameSeamPlace = 1e-6;     // unit box; wider than rounding between instances, far below a texel

struct BorderEdge {
  std::uint32_t low = 0, high = 0;  ///< welded ends
  std::uint32_t triangle = 0;       ///< patch triangle
  std::uint32_t corner_low = 0, corner_high = 0;
};

/// Edges of patch triangles whose other side is not in the same chart with the same texel coordinates, where no wall
/// stands on them.
std::vector<BorderEdge> borderEdges(const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
                                    const std::vector<std::uint32_t>& sources, const PatchScene& patches) {
  std::vector<std::uint32_t> patch_of(flat.triangles.size(), kNone);
  for (std::uint32_t t = 0; t < sources.size(); ++t) patch_of[sources[t]] = t;
  const auto texelOf = [&](std::uint32_t t, std::uint32_t corner) {
    return patches.vertices[patches.indices[std::size_t{3} * t + corner]].texel;
  };
  const auto holdsCorner = [&](std::uint32_t t, std::uint32_t point, const glm::vec2& texel) {
    for (std::uint32_t c = 0; c < 3; ++c)
      if (flat.triangles[sources[t]].points[c] == point && glm::distance(texelOf(t, c), texel) < 1e-3F) return true;
    return false;
  };
  std::vector<BorderEdge> edges;
  std::vector<glm::dvec3> ends;
  for (std::uint32_t t = 0; t < sources.size(); ++t)
    for (std::uint32_t e = 0; e < 3; ++e) {
      const std::uint32_t next = (e + 1) % 3;
      const FlatTriangle& triangle = flat.triangles[sources[t]];
      const std::uint32_t across = neighbours[std::size_t{3} * sources[t] + e];
      const std::uint32_t other = across == kNone ? kNone : patch_of[across];
      if (other != kNone && patches.triangle_surface[other] == patches.triangle_surface[t] &&
          holdsCorner(other, triangle.points[e], texelOf(t, e)) &&
          holdsCorner(other, triangle.points[next], texelOf(t, next)))
        continue;
      if ((triangle.walled >> e & 1U) != 0U) continue;
      edges.push_back({0, 0, t, e, next});
      ends.push_back(flat.points[triangle.points[e]]);
      ends.push_back(flat.points[triangle.points[next]]);
    }
  const std::vector<std::uint32_t> ids = weldPoints(ends, kSameSeamPlace);
  for (std::size_t i = 0; i < edges.size(); ++i) {
    edges[i].low = ids[2 * i];
    edges[i].high = ids[2 * i + 1];
    if (edges[i].low <= edges[i].high) continue;
    std::swap(edges[i].low, edges[i].high);
    std::swap(edges[i].corner_low, edges[i].corner_high);
  }
  std::erase_if(edges, [](const BorderEdge& edge) { return edge.low == edge.high; });
  std::ranges::sort(edges, [](const BorderEdge& a, const BorderEdge& b) {
    if (a.low != b.low) return a.low < b.low;
    if (a.high != b.high) return a.high < b.high;
    return a.triangle < b.triangle;
  });
  return edges;
}

}  // namespace

void findSeams(const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
               const std::vector<std::uint32_t>& sources, double smooth_deg, const ShadingNormals& normals,
               PatchScene& patches) {
  const std::vector<BorderEdge> edges = borderEdges(flat, neighbours, sources, patches);
  const auto smooth = static_cast<float>(std::cos(smooth_deg * M_PI / 180.0));
  const auto texelOf = [&](std::uint32_t t, std::uint32_t corner) {
    return patches.vertices[patches.indices[std::size_t{3} * t + corner]].texel;
  };
  const auto normalAt = [&](const BorderEdge& edge, std::uint32_t corner) {
    return normals.at(edge.triangle, texelOf(edge.triangle, corner),
                      glm::dvec3(patches.triangles[edge.triangle].normal));
  };
  const auto looksSmooth = [&](const BorderEdge& x, const BorderEdge& y) {
    return normals.has(x.triangle) && normals.has(y.triangle) &&
           glm::dot(normalAt(x, x.corner_low), normalAt(y, y.corner_low)) > kSameSeamNormal &&
           glm::dot(normalAt(x, x.corner_high), normalAt(y, y.corner_high)) > kSameSeamNormal;
  };
  for (std::size_t i = 0; i < edges.size();) {
    interruptionPoint();
    const auto most = std::min(edges.size(), i + 16);  // a book of pages; the rest of the group is looked at on its own
    std::size_t end = i + 1;
    while (end < most && edges[end].low == edges[i].low && edges[end].high == edges[i].high) ++end;
    for (std::size_t a = i; a < end; ++a)
      for (std::size_t b = a + 1; b < end; ++b) {
        const BorderEdge &x = edges[a], &y = edges[b];
        // Neighbours run along their edge in opposite directions; the same direction means back to back or doubled.
        const bool opposite = ((x.corner_low + 1) % 3 == x.corner_high) != ((y.corner_low + 1) % 3 == y.corner_high);
        if (!opposite) continue;
        if (glm::dot(patches.triangles[x.triangle].normal, patches.triangles[y.triangle].normal) < smooth &&
            !looksSmooth(x, y))
          continue;
        PatchScene::Seam seam{};
        seam.surface = {patches.triangle_surface[x.triangle], patches.triangle_surface[y.triangle]};
        seam.texel[0] = {texelOf(x.triangle, x.corner_low), texelOf(x.triangle, x.corner_high)};
        seam.texel[1] = {texelOf(y.triangle, y.corner_low), texelOf(y.triangle, y.corner_high)};
        patches.seams.push_back(seam);
      }
    i = end;
  }
}

}  // namespace radiosity::scene
