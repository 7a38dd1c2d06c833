#include "server/solver/patches/lights.h"

#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>
#include <optional>
#include <utility>

namespace radiosity::solver {
namespace {

/// More polygons than this on one surface (a tessellated lamp) cost more as gather shots than as scatter shots.
constexpr std::uint32_t kMaxPolygonsPerSurface = 16;

std::array<glm::vec3, 3> triangleCorners(const scene::PatchScene& patches, std::uint32_t triangle) {
  std::array<glm::vec3, 3> corners{};
  for (std::uint32_t k = 0; k < 3; ++k) corners[k] = patches.vertices[patches.indices[3 * triangle + k]].position;
  return corners;
}

/// A polygon shines whole. Of its area no more may lie in solids or behind what covers it than so small a part, which
/// errors that are asked for do not show; whether anything does, rounding leaves open: leaves know their areas in
/// single precision, each clipped apart.
constexpr double kHidden = 1e-3;

/// Whether all of the triangles can be seen on this side.
bool isWhole(const scene::PatchScene& patches, const Side& side) {
  const auto& surface = patches.surfaces[side.surface];
  double whole = 0.0, seen = 0.0;
  for (auto t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t) {
    const auto [a, b, c] = triangleCorners(patches, t);
    whole += 0.5 * glm::length(glm::cross(glm::dvec3(b) - glm::dvec3(a), glm::dvec3(c) - glm::dvec3(a)));
  }
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
    seen += static_cast<double>(patches.node_area[side.first_node + leaf]);
  return seen >= (1.0 - kHidden) * whole;
}

/// Of one emission. Leaves differ by so small a part where it is a texture of one colour, whose pixels are averaged.
constexpr float kSameEmission = 1e-5F;

bool uniformEmission(const scene::PatchScene& patches, const Side& side, scene::SideColours::OfSide emissions,
                     glm::vec3& emission) {
  bool found = false;
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    if (patches.node_area[side.first_node + leaf] <= 0.0F) continue;
    const glm::vec3 here = emissions[leaf];
    if (!found) emission = here;
    found = true;
    if (!glm::all(glm::lessThanEqual(glm::abs(here - emission), kSameEmission * emission))) return false;
  }
  return found && emission != glm::vec3(0.0F);
}

/// The quad a, b, c, d if two triangles share an edge and their union is a convex quadrilateral.
std::optional<std::array<glm::vec3, 4>> joinTriangles(const std::array<glm::vec3, 3>& s,
                                                      const std::array<glm::vec3, 3>& t, const glm::vec3& normal) {
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) {
      if (s[i] != t[(k + 1) % 3] || s[(i + 1) % 3] != t[k]) continue;
      const std::array<glm::vec3, 4> quad = {s[i], t[(k + 2) % 3], s[(i + 1) % 3], s[(i + 2) % 3]};
      for (std::size_t c = 0; c < 4; ++c) {
        const glm::vec3 in = quad[(c + 1) % 4] - quad[c], out = quad[(c + 2) % 4] - quad[(c + 1) % 4];
        if (glm::dot(glm::cross(in, out), normal) <= 0.0F) return std::nullopt;
      }
      return quad;
    }
  }
  return std::nullopt;
}

double polygonArea(const LightPolygon& light) {
  glm::dvec3 sum(0.0);
  for (std::uint32_t k = 1; k + 1 < light.corner_count; ++k) {
    sum += glm::cross(glm::dvec3(light.corners[k] - light.corners[0]),
                      glm::dvec3(light.corners[k + 1] - light.corners[0]));
  }
  return 0.5 * glm::length(sum);
}

void addPolygons(const scene::PatchScene& patches, const Side& side, const glm::vec3& emission,
                 std::vector<LightPolygon>& lights) {
  const auto& surface = patches.surfaces[side.surface];
  std::vector<bool> used(surface.triangle_count, false);
  for (std::uint32_t i = 0; i < surface.triangle_count; ++i) {
    if (used[i]) continue;
    const std::uint32_t triangle = surface.first_triangle + i;
    const glm::vec3 normal = patches.triangles[triangle].normal;
    const auto corners = triangleCorners(patches, triangle);
    LightPolygon light;
    std::copy(corners.begin(), corners.end(), light.corners.begin());
    light.key = 2 * (side.triangle_key + i) + side.side;
    for (std::uint32_t k = i + 1; k < surface.triangle_count && light.corner_count == 3; ++k) {
      if (used[k]) continue;
      if (const auto quad = joinTriangles(corners, triangleCorners(patches, surface.first_triangle + k), normal)) {
        light.corners = *quad;
        light.corner_count = 4;
        used[k] = true;
      }
    }
    light.normal = normal;
    if (side.side == 1) {
      light.normal = -normal;
      std::swap(light.corners[0], light.corners[light.corner_count - 1]);
      if (light.corner_count == 4) std::swap(light.corners[1], light.corners[2]);
    }
    light.emission = emission;
    light.area = polygonArea(light);
    if (light.area > 0.0) lights.push_back(light);
  }
}

}  // namespace

bool isParallelogram(std::span<const glm::vec3> corners) {
  constexpr float kRounding = 1e-5F;
  return corners.size() == 4 && glm::distance(corners[0] + corners[2], corners[1] + corners[3]) <=
                                    kRounding * glm::distance(corners[0], corners[2]);
}

glm::vec4 LightPolygon::ball() const {
  const std::span all(corners.data(), corner_count);
  glm::vec3 middle(0.0F);
  for (const auto& corner : all) middle += corner / static_cast<float>(all.size());
  float radius = 0.0F;
  for (const auto& corner : all) radius = std::max(radius, glm::distance(middle, corner));
  return {middle, radius};
}

glm::vec3 LightPolygon::point(double u, double v) const {
  const glm::dvec3 a(corners[0]), b(corners[1]), c(corners[2]), d(corners[3]);
  if (isParallelogram(std::span(corners.data(), corner_count))) return glm::vec3(a + u * (b - a) + v * (d - a));
  double first = 1.0;  // share of the area in triangle a b c
  if (corner_count == 4) {
    const double abc = glm::length(glm::cross(b - a, c - a)), acd = glm::length(glm::cross(c - a, d - a));
    first = abc / (abc + acd);
  }
  const bool in_first = u < first;
  const double s = in_first ? u / first : (u - first) / (1.0 - first);
  // Area-preserving map of the unit square to a triangle that keeps stratification (square root warp).
  const double root = std::sqrt(s);
  const glm::dvec3 p = in_first ? b : c, q = in_first ? c : d;
  return glm::vec3((1.0 - root) * a + root * ((1.0 - v) * p + v * q));
}

std::vector<LightPolygon> findLightPolygons(const scene::PatchScene& patches, std::vector<Side>& sides,
                                            const scene::SideColours& emission) {
  std::vector<LightPolygon> lights;
  for (auto& side : sides) {
    const auto& surface = patches.surfaces[side.surface];
    glm::vec3 uniform(0.0F);
    side.gathered = surface.planar && !surface.see_through && surface.triangle_count <= 2 * kMaxPolygonsPerSurface &&
                    uniformEmission(patches, side, emission.side(side.number), uniform) && isWhole(patches, side);
    if (side.gathered) addPolygons(patches, side, uniform, lights);
  }
  return lights;
}

}  // namespace radiosity::solver
