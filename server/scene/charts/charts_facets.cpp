#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>

#include "common/task.h"
#include "server/scene/charts/charts.h"

namespace radiosity::scene {
namespace {

constexpr double kSameNormal = 0.99998;    // cos 0.36 degrees
constexpr double kSliverSameNormal = 0.5;  // a sliver's normal is noise; its distance from the plane decides
constexpr double kPlaneTolerance = 5.0;    // times the instance's rounding
constexpr double kSliverHeight = 300.0;    // times the instance's rounding

bool isSliver(const FlatScene& flat, const FlatTriangle& triangle) {
  double longest = 0.0;
  for (int e = 0; e < 3; ++e)
    longest = std::max(longest, glm::distance(flat.points[triangle.points[static_cast<std::size_t>(e)]],
                                              flat.points[triangle.points[static_cast<std::size_t>((e + 1) % 3)]]));
  return 2.0 * triangle.area < kSliverHeight * flat.tolerance[triangle.instance] * longest;
}

bool inPlane(const FlatScene& flat, const FlatTriangle& triangle, const glm::dvec3& normal, const glm::dvec3& point) {
  const double bound = kPlaneTolerance * flat.tolerance[triangle.instance];
  if (!std::ranges::all_of(triangle.points, [&](std::uint32_t p) {
        return std::abs(glm::dot(normal, flat.points[p] - point)) <= bound;
      }))
    return false;
  const double cosine = glm::dot(normal, triangle.normal);
  return cosine >= kSameNormal || (cosine >= kSliverSameNormal && isSliver(flat, triangle));
}

}  // namespace

Facets findFacets(const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
                  const std::vector<bool>& wanted) {
  Facets result;
  result.of_triangle.assign(flat.triangles.size(), kNone);
  std::vector<std::uint32_t> order(flat.triangles.size());
  std::iota(order.begin(), order.end(), 0U);
  // Large triangles know their plane best. The relative threshold keeps rounding from reordering equal ones.
  std::ranges::stable_sort(order, [&](std::uint32_t a, std::uint32_t b) {
    return std::ilogb(flat.triangles[a].area) > std::ilogb(flat.triangles[b].area);
  });
  for (const std::uint32_t seed : order) {
    interruptionPoint();
    if (!wanted[seed] || result.of_triangle[seed] != kNone) continue;
    const auto id = static_cast<std::uint32_t>(result.facets.size());
    Facets::Facet facet;
    facet.normal = flat.triangles[seed].normal;
    const glm::dvec3 point = flat.points[flat.triangles[seed].points[0]];
    facet.triangles.push_back(seed);
    result.of_triangle[seed] = id;
    for (std::size_t i = 0; i < facet.triangles.size(); ++i) {
      const std::uint32_t t = facet.triangles[i];
      facet.area += flat.triangles[t].area;
      for (std::size_t e = 0; e < 3; ++e) {
        const std::uint32_t other = neighbours[std::size_t{3} * t + e];
        if (other == kNone || !wanted[other] || result.of_triangle[other] != kNone) continue;
        if (!inPlane(flat, flat.triangles[other], facet.normal, point)) continue;
        result.of_triangle[other] = id;
        facet.triangles.push_back(other);
      }
    }
    result.facets.push_back(std::move(facet));
  }
  return result;
}

}  // namespace radiosity::scene
