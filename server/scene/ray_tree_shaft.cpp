// RayTree: which points of a polygon triangles hide from a place, all points and few triangles at a time, where single
// rays would meet the same triangles again and again (Schwarz and Stamminger 2007, "Bitmask soft shadows", for whole
// triangles instead of texels of a shadow map).
#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/clones.h"
#include "server/scene/ray_tree.h"

namespace radiosity::scene {
namespace {

constexpr std::size_t kLanes = RayTree::kWidth;

inline float larger(float a, float b) { return a > b ? a : b; }

/// Some of whose eight boxes reach inside of a shaft, as bits: not those that lie behind one of its planes.
__attribute__((always_inline)) inline std::uint32_t boxesInside(const WideNodes::Node& node, const Shaft& shaft) {
  float nearest[kLanes];
  for (auto& lane : nearest) lane = 1.0F;
  for (std::size_t p = 0; p < shaft.count; ++p) {
    const auto& n = shaft.plane[p];
    const float* x = node.plane[n.x > 0.0F ? 3 : 0].data();
    const float* y = node.plane[n.y > 0.0F ? 4 : 1].data();
    const float* z = node.plane[n.z > 0.0F ? 5 : 2].data();
    for (std::size_t k = 0; k < kLanes; ++k) {
      const float height = n.x * x[k] + n.y * y[k] + n.z * z[k] + n.w;
      nearest[k] = nearest[k] < height ? nearest[k] : height;
    }
  }
  std::uint32_t mask = 0;
  for (std::size_t k = 0; k < kLanes; ++k) mask |= nearest[k] > 0.0F ? 1U << k : 0U;
  return mask;
}

/// The same of triangles.
__attribute__((always_inline)) inline std::uint32_t trianglesInside(const TriangleLanes& block, const Shaft& shaft) {
  const auto &c = block.corner, &a = block.edge1, &b = block.edge2;
  float nearest[kLanes];
  for (auto& lane : nearest) lane = 1.0F;
  for (std::size_t p = 0; p < shaft.count; ++p) {
    const auto& n = shaft.plane[p];
    for (std::size_t k = 0; k < kLanes; ++k) {
      const float at = n.x * c[0][k] + n.y * c[1][k] + n.z * c[2][k] + n.w;
      const float along = n.x * a[0][k] + n.y * a[1][k] + n.z * a[2][k];
      const float across = n.x * b[0][k] + n.y * b[1][k] + n.z * b[2][k];
      const float highest = at + larger(0.0F, larger(along, across));
      nearest[k] = nearest[k] < highest ? nearest[k] : highest;
    }
  }
  std::uint32_t mask = 0;
  for (std::size_t k = 0; k < kLanes; ++k) mask |= nearest[k] > 0.0F ? 1U << k : 0U;
  return mask;
}

/// A triangle as a place sees it: a way d from there passes it where all four are at least what is asked.
struct Facet {
  glm::vec3 edge[3], plane;
  float slack, height;
};

/// Which points of so many lie behind a facet.
__attribute__((always_inline)) inline void hideBehind(const Facet& facet, const glm::vec3& from, std::size_t count,
                                                      const float* x, const float* y, const float* z,
                                                      std::int32_t* hidden) {
  const auto [e0, e1, e2] = facet.edge;
  const auto n = facet.plane;
  const float least = -facet.slack, height = facet.height;
  for (std::size_t i = 0; i < count; ++i) {
    const float dx = x[i] - from.x, dy = y[i] - from.y, dz = z[i] - from.z;
    const float a = e0.x * dx + e0.y * dy + e0.z * dz, b = e1.x * dx + e1.y * dy + e1.z * dz;
    const float c = e2.x * dx + e2.y * dy + e2.z * dz, d = n.x * dx + n.y * dy + n.z * dz;
    const bool is_hidden = (a >= least) & (b >= least) & (c >= least) & (d > height);
    hidden[i] |= is_hidden ? 1 : 0;
  }
}

}  // namespace

Shaft::Shaft(const glm::vec3& place, const glm::vec3& normal, std::span<const glm::vec3> corners,
             const glm::vec3& of_end, float spare)
    : from(place) {
  const auto add = [&](const glm::vec3& inwards, const glm::vec3& on, float offset) {
    plane[count++] = glm::vec4(inwards, offset - glm::dot(inwards, on));
  };
  glm::vec3 middle(0.0F);
  for (const auto& corner : corners) {
    middle += corner / static_cast<float>(corners.size());
    length = larger(length, glm::distance(from, corner));
  }
  for (std::size_t i = 0; i < std::min(corners.size(), kMostSides); ++i) {
    const auto across = glm::cross(corners[i] - from, corners[(i + 1) % corners.size()] - from);
    const float size = glm::length(across);
    if (!(size > 0.0F)) continue;
    add((glm::dot(across, middle - from) < 0.0F ? -1.0F : 1.0F) / size * across, from, spare);
  }
  add(normal, from, -spare);
  add(of_end, corners[0], -spare);
}

RADIOSITY_CLONES bool RayTree::hide(const Shaft& shaft, const ShaftPoints& points, std::size_t most,
                                    std::int32_t* hidden) const {
  const std::size_t count = points.x.size();
  std::fill_n(hidden, count, 0);
  if (nodes_.empty()) return true;
  std::uint32_t stack[WideNodes::kStackDepth];
  std::size_t depth = 1, triangles = 0;
  stack[0] = 0;
  while (depth > 0) {
    const auto child = stack[--depth];
    if ((child & WideNodes::kLeaf) == 0) {
      const auto& node = nodes_[child];
      for (auto mask = boxesInside(node, shaft); mask != 0; mask &= mask - 1)
        stack[depth++] = node.child[static_cast<std::size_t>(std::countr_zero(mask))];
      continue;
    }
    const Block& block = blocks_[child & ~WideNodes::kLeaf];
    for (auto mask = trianglesInside(block, shaft); mask != 0; mask &= mask - 1) {
      const auto k = static_cast<std::size_t>(std::countr_zero(mask));
      const auto vector = [&](const std::array<TriangleLanes::Lanes<float>, 3>& of) {
        return glm::vec3(of[0][k], of[1][k], of[2][k]);
      };
      const glm::vec3 a = vector(block.corner) - shaft.from, e1 = vector(block.edge1), e2 = vector(block.edge2);
      const glm::vec3 b = a + e1, c = a + e2, plane = glm::cross(e1, e2);
      const float height = glm::dot(plane, a), sign = height < 0.0F ? -1.0F : 1.0F;
      if (height == 0.0F) continue;  // edge on, or a lane without a triangle
      if (++triangles > most) return false;
      const Facet facet{{sign * glm::cross(a, b), sign * glm::cross(b, c), sign * glm::cross(c, a)},
                        sign * plane,
                        block.slack[k] * shaft.length,  // as much for each unit of the way
                        sign * height};
      hideBehind(facet, shaft.from, count, points.x.data(), points.y.data(), points.z.data(), hidden);
    }
  }
  return true;
}

}  // namespace radiosity::scene
