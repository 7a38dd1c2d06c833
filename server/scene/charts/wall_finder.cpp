#include "server/scene/charts/wall_finder.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/task.h"
#include "common/union_find.h"
#include "server/scene/shading/opacity.h"
#include "server/scene/values/material_of.h"

namespace radiosity::scene {
namespace {

/// Faces whose normals are nearer than this do not stand on each other: 26 degrees.
constexpr double kLeaning = 0.9;
/// Of the least size: a gap below a wall through which hardly any light comes.
constexpr double kGap = 0.02;
/// Of the least size squared: a smaller facet is no wall.
constexpr double kLeastWall = 0.5;
/// Triangles near one face, and near all faces together. A building has fewer; what has more is cut nowhere else.
constexpr std::size_t kMostNear = 20'000, kMostWallLooks = 4'000'000;

}  // namespace

FacetPlane::FacetPlane(const FlatScene& flat, const Facets::Facet& facet)
    : origin(flat.points[flat.triangles[facet.triangles.front()].points[0]]), normal(facet.normal) {
  const auto axis = std::abs(normal.x) < 0.6 ? glm::dvec3(1.0, 0.0, 0.0) : glm::dvec3(0.0, 1.0, 0.0);
  x = glm::normalize(axis - normal * glm::dot(normal, axis));
  y = glm::cross(normal, x);
}

WallFinder::WallFinder(const Scene& scene, const FlatScene& flat, const std::vector<std::uint32_t>& neighbours,
                       const Facets& facets, const CutScale& scale)
    : scene_(scene), flat_(flat), facets_(facets), scale_(scale), touch_(kGap * scale.least) {
  std::vector<bool> hides(scene.instances.size());
  for (std::size_t i = 0; i < hides.size(); ++i) hides[i] = !isSeeThrough(materialOf(scene, scene.instances[i]));
  std::vector<Bvh::Triangle> corners;
  for (std::uint32_t t = 0; t < flat.triangles.size(); ++t) {
    const auto& triangle = flat.triangles[t];
    const auto facet = facets.of_triangle[t];
    if (facet == kNone || !hides[triangle.instance]) continue;
    if (facets.facets[facet].area < kLeastWall * scale.least * scale.least) continue;
    triangles_.push_back(t);
    corners.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) corners.back()[k] = glm::vec3(flat.points[triangle.points[k]]);
  }
  tree_ = Bvh(std::move(corners));
  findClosedParts(neighbours);
}

void WallFinder::findClosedParts(const std::vector<std::uint32_t>& neighbours) {
  UnionFind parts(flat_.triangles.size());
  for (std::size_t i = 0; i < neighbours.size(); ++i)
    if (neighbours[i] != kNone) parts.join(static_cast<std::uint32_t>(i / 3), neighbours[i]);
  std::vector<bool> open(flat_.triangles.size(), false);
  for (std::size_t i = 0; i < neighbours.size(); ++i)
    if (neighbours[i] == kNone) open[parts.find(static_cast<std::uint32_t>(i / 3))] = true;
  for (std::uint32_t t = 0; t < flat_.triangles.size(); ++t)
    closed_part_.push_back(open[parts.find(t)] ? kNone : parts.find(t));
}

/// The backs of what is closed all around are seen from within alone, as of a room that is turned inside out.
bool WallFinder::showsBack(std::uint32_t wall, std::uint32_t face) const {
  return isDoubleSided(wall) && (closed_part_[wall] == kNone || closed_part_[wall] == closed_part_[face]);
}

bool WallFinder::isDoubleSided(std::uint32_t triangle) const {
  return materialOf(scene_, scene_.instances[flat_.triangles[triangle].instance]).double_sided;
}

std::vector<WallSegment> WallFinder::wallsOn(std::uint32_t facet, const FacetPlane& plane) {
  gave_up_ = gave_up_ || looked_at_ > kMostWallLooks;
  if (looked_at_ > kMostWallLooks) return {};
  const auto margin = static_cast<float>(2.0 * touch_);
  std::vector<std::uint32_t> near;
  for (const auto t : facets_.facets[facet].triangles) {
    interruptionPoint();
    glm::vec3 low(flat_.points[flat_.triangles[t].points[0]]), high = low;
    for (const auto p : flat_.triangles[t].points) {
      low = glm::min(low, glm::vec3(flat_.points[p]));
      high = glm::max(high, glm::vec3(flat_.points[p]));
    }
    const auto before = near.size();
    const bool all = tree_.collectNear(low - margin, high + margin, kMostNear, near);
    looked_at_ += near.size() - before;
    gave_up_ = gave_up_ || !all || looked_at_ > kMostWallLooks;
    if (!all || looked_at_ > kMostWallLooks) return {};
  }
  std::ranges::sort(near);
  near.erase(std::unique(near.begin(), near.end()), near.end());
  const bool both_sides = isDoubleSided(facets_.facets[facet].triangles.front());
  Meetings found;
  for (const auto i : near) {
    if (facets_.of_triangle[triangles_[i]] == facet) continue;
    meet(triangles_[i], plane, false, found);
    if (both_sides) meet(triangles_[i], plane, true, found);
  }
  std::vector<WallSegment> walls;
  for (const auto& [of, meeting] : found) addWalls(of.first, facet, meeting, plane, walls);
  return walls;
}

/// The plane is moved a little, to the side where the wall is looked for; what is met there is moved back, along the
/// wall, into the plane.
void WallFinder::meet(std::uint32_t wall, const FacetPlane& plane, bool behind, Meetings& found) const {
  const auto& triangle = flat_.triangles[wall];
  if (std::abs(glm::dot(triangle.normal, plane.normal)) > kLeaning) return;
  std::array<double, 3> height{};
  std::array<glm::dvec2, 3> at{};
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& p = flat_.points[triangle.points[k]];
    height[k] = (behind ? -1.0 : 1.0) * plane.height(p) - touch_;
    at[k] = plane.project(p);
  }
  std::vector<glm::dvec2> ends;
  for (std::size_t k = 0; k < 3; ++k) {
    const double h = height[k], g = height[(k + 1) % 3];
    if ((h > 0.0) != (g > 0.0)) ends.push_back(at[k] + (at[(k + 1) % 3] - at[k]) * (h / (h - g)));
  }
  if (ends.size() != 2) return;
  auto& meeting = found[{facets_.of_triangle[wall], behind}];
  const glm::dvec2 across(glm::dot(triangle.normal, plane.x), glm::dot(triangle.normal, plane.y));
  const double up = glm::dot(triangle.normal, plane.normal) * (behind ? -touch_ : touch_);
  const auto back = across * (up / glm::dot(across, across));
  meeting.segments.emplace_back(ends[0] + back, ends[1] + back);
  meeting.height = std::max(meeting.height, *std::ranges::max_element(height) + touch_);
}

/// A facet is flat, so that all its segments lie on one line; those that meet are one.
void WallFinder::addWalls(std::uint32_t facet, std::uint32_t on, const Meeting& meeting, const FacetPlane& plane,
                          std::vector<WallSegment>& walls) const {
  const auto length = [](const auto& segment) { return glm::distance(segment.first, segment.second); };
  const auto& longest = *std::ranges::max_element(meeting.segments, {}, length);
  if (!(length(longest) > 4.0 * scale_.rounding)) return;
  const glm::dvec2 from = longest.first, along = glm::normalize(longest.second - longest.first);
  std::vector<std::pair<double, double>> ranges;
  for (const auto& [a, b] : meeting.segments)
    ranges.push_back(std::minmax({glm::dot(a - from, along), glm::dot(b - from, along)}));
  std::ranges::sort(ranges);
  const glm::dvec3 normal = facets_.facets[facet].normal;
  WallSegment wall;
  wall.front = {glm::dot(normal, plane.x), glm::dot(normal, plane.y)};
  wall.shows_back = showsBack(facets_.facets[facet].triangles.front(), facets_.facets[on].triangles.front());
  wall.height = meeting.height;
  for (std::size_t i = 0; i < ranges.size();) {
    auto [first, last] = ranges[i];
    for (++i; i < ranges.size() && ranges[i].first <= last + 4.0 * scale_.rounding; ++i)
      last = std::max(last, ranges[i].second);
    wall.from = from + first * along;
    wall.to = from + last * along;
    walls.push_back(wall);
  }
}

}  // namespace radiosity::scene
