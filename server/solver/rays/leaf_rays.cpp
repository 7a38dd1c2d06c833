#include "server/solver/rays/leaf_rays.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <new>
#include <numbers>
#include <span>
#include <utility>

#include "common/log.h"
#include "server/scene/values/leaf_opacity.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Rays start so far from a surface (unit box), well above the rounding of positions.
constexpr double kLift = 2e-6;
/// Places lie so far within the edges of whole leaves: on an edge rounding may place one behind another wall, whose
/// back ends its rays, or which they pass by.
constexpr double kWithin = 1e-6, kMostWithin = 0.01;
/// Planes of triangles are known to some 1e-7: places on them, along a ray, to so many times less.
constexpr double kLeastSlope = 0.05;
/// Farther than the unit box is wide.
constexpr double kFar = 4.0;
/// What a ray in single precision is sent to is known to so much (unit box).
constexpr double kNearEnd = 1e-5;
/// What lies in the plane of a point to so much is met so much before or behind it, at flat angles.
constexpr double kNearPlane = 2e-4;
/// A ray keeps in mind so many that it went through; then it starts anew from the last of them, so often at most.
constexpr std::size_t kMostSheets = 64, kMostStarts = 64;
/// Sheets within this of the last may lie in the same place (geometry::RayScene).
constexpr float kSameSheet = 4e-6F;

/// Where in a frame a point of its plane lies.
glm::dvec2 texelAt(const scene::TriangleFrame& frame, const glm::dvec3& point) {
  const glm::dvec3 way = point - glm::dvec3(frame.origin), u(frame.du), v(frame.dv);
  const double uu = glm::dot(u, u), uv = glm::dot(u, v), vv = glm::dot(v, v);
  const double along_u = glm::dot(way, u), along_v = glm::dot(way, v), determinant = uu * vv - uv * uv;
  return {(along_u * vv - along_v * uv) / determinant, (along_v * uu - along_u * uv) / determinant};
}

glm::dvec3 positionAt(const scene::TriangleFrame& frame, const glm::dvec2& texel) {
  return glm::dvec3(frame.origin) + texel.x * glm::dvec3(frame.du) + texel.y * glm::dvec3(frame.dv);
}

glm::dvec3 lifted(const LeafRays::Place& place) { return place.position + kLift * place.normal; }

}  // namespace

glm::dvec3 cosineDirection(const glm::dvec3& normal, double u, double v) {
  const glm::dvec3 helper = std::abs(normal.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 a = glm::normalize(glm::cross(helper, normal)), b = glm::cross(normal, a);
  const double radius = std::sqrt(u), angle = 2.0 * std::numbers::pi * v;
  return radius * std::cos(angle) * a + radius * std::sin(angle) * b + std::sqrt(std::max(0.0, 1.0 - u)) * normal;
}

LeafRays::LeafRays(const scene::PatchScene& patches, const std::vector<Side>& sides)
    : patches_(patches), sides_(sides), side_of_(patches.surfaces.size(), {scene::kNone, scene::kNone}) {
  std::vector<geometry::Triangle> triangles(patches.triangles.size());
  for (std::size_t i = 0; i < patches.indices.size(); ++i)
    triangles[i / 3][i % 3] = patches.vertices[patches.indices[i]].position;
  auto built = geometry::RayScene::build(triangles);
  if (!built) {
    log::error("what leaves see cannot be looked for: {}", built.error().text());
    throw std::bad_alloc();
  }
  rays_ = std::move(*built);
  std::size_t leaves = 0;
  for (const auto& side : sides) leaves += side.leaf_count;
  side_of_value_.reserve(leaves);
  for (std::uint32_t s = 0; s < sides.size(); ++s) {
    side_of_value_.insert(side_of_value_.end(), sides[s].leaf_count, s);
    side_of_[sides[s].surface][sides[s].side] = s;
    greatest_width_ = std::max(greatest_width_, widthOf(sides[s].first_value));
  }
  findStandIns();
  findEven();
}

/// Charts of a file may be flat but for the rounding of their corners.
void LeafRays::findEven() {
  for (const auto& surface : patches_.surfaces) {
    const auto of = std::span(patches_.triangles).subspan(surface.first_triangle, surface.triangle_count);
    is_even_.push_back(surface.planar && std::ranges::all_of(of, [&](const scene::TriangleFrame& frame) {
                         return frame.normal == of.front().normal;
                       }));
  }
}

void LeafRays::findStandIns() {
  has_stand_in_.reserve(side_of_value_.size());
  is_cut_.reserve(side_of_value_.size());
  for (const auto& side : sides_) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const bool whole = patches_.node_area[side.first_node + leaf] > 0.0F;
      has_stand_in_.push_back(!whole);
      if (!whole) stand_ins_.emplace_back(side.first_value + leaf, neighbourOf(side, leaf));
      is_cut_.push_back(whole && patches_.leaves[patches_.surfaces[side.surface].first_leaf + leaf].cut);
    }
  }
}

std::uint32_t LeafRays::foundStandIn(std::uint32_t value) const {
  return std::ranges::lower_bound(stand_ins_, value, {}, [](const auto& pair) { return pair.first; })->second;
}

/// Who is lit in the place of a leaf without area: what covers it, or the first of the eight around it that has some.
std::uint32_t LeafRays::neighbourOf(const Side& side, std::uint32_t leaf) const {
  const auto has_area = [&](const Side& of, std::uint32_t which) {
    return patches_.node_area[of.first_node + which] > 0.0F;
  };
  const auto number = patches_.surfaces[side.surface].first_leaf + leaf;
  auto cover = std::ranges::lower_bound(patches_.covered, number, {}, &scene::PatchScene::Covered::leaf);
  while (cover != patches_.covered.end() && cover->leaf == number && cover->side != side.side) ++cover;
  if (cover != patches_.covered.end() && cover->leaf == number) {
    if (const auto s = side_of_[cover->surface][cover->surface_side]; s != scene::kNone) {
      const auto x = std::clamp(cover->texel.x, 0.0F, static_cast<float>(sides_[s].width - 1));
      const auto y = std::clamp(cover->texel.y, 0.0F, static_cast<float>(sides_[s].height - 1));
      const auto there = static_cast<std::uint32_t>(y) * sides_[s].width + static_cast<std::uint32_t>(x);
      if (has_area(sides_[s], there)) return sides_[s].first_value + there;
    }
  }
  const auto x = leaf % side.width, y = leaf / side.width;
  for (auto ny = y - std::min(y, 1U); ny < std::min(y + 2, side.height); ++ny) {
    for (auto nx = x - std::min(x, 1U); nx < std::min(x + 2, side.width); ++nx)
      if (has_area(side, ny * side.width + nx)) return side.first_value + ny * side.width + nx;
  }
  return kNothing;
}

double LeafRays::areaOf(std::uint32_t value) const {
  const Side& side = sideOf(value);
  return static_cast<double>(patches_.node_area[side.first_node + value - side.first_value]);
}

double LeafRays::coveredAreaOf(std::uint32_t value) const {
  const Side& side = sideOf(value);
  const auto stopped = scene::stoppedByLeaf(patches_, patches_.surfaces[side.surface], value - side.first_value);
  return stopped > 0.0F ? areaOf(value) / static_cast<double>(stopped) : 0.0;
}

double LeafRays::widthOf(std::uint32_t value) const {
  return std::sqrt(static_cast<double>(patches_.surfaces[sideOf(value).surface].texel_area));
}

LeafRays::Place LeafRays::placeOn(std::uint32_t value, const glm::dvec2& at) const {
  const Side& side = sideOf(value);
  const auto leaf = value - side.first_value;
  const auto& point = patches_.leaves[patches_.surfaces[side.surface].first_leaf + leaf];
  const double within = std::min(kWithin / widthOf(value), kMostWithin);
  const auto inside = glm::clamp(at, within, 1.0 - within);
  const auto [texel, triangle] = patches_.spotAt(point, leaf % side.width, leaf / side.width, glm::vec2(inside));
  const auto& frame = patches_.triangles[triangle];
  return {positionAt(frame, glm::dvec2(texel)), glm::dvec3(side.side == 0 ? frame.normal : -frame.normal), value,
          triangle};
}

glm::dvec2 LeafRays::texelOf(const Place& place) const {
  return texelAt(patches_.triangles[place.triangle], place.position);
}

LeafRays::Sight LeafRays::look(const Place& from, const glm::dvec3& direction, double reach) const {
  Sight sight;
  sight.distance = reach;
  const auto origin = lifted(from);
  const auto hit = rays_.nearest({glm::vec3(origin), glm::vec3(direction), static_cast<float>(reach), from.triangle});
  if (!hit.found()) return sight;
  const auto t = static_cast<double>(hit.t);
  sight.distance = t;
  const auto s = side_of_[patches_.triangle_surface[hit.triangle]][hit.front ? 0 : 1];
  if (s == scene::kNone) return sight;
  const auto& frame = patches_.triangles[hit.triangle];
  const auto texel = texelAt(frame, origin + t * direction);
  const auto value = leafAt(sides_[s], texel);
  sight.end = {positionAt(frame, texel), glm::dvec3(hit.front ? frame.normal : -frame.normal), kNothing, hit.triangle};
  if (!has_stand_in_[value]) sight.end.value = value;
  return sight;
}

std::uint32_t LeafRays::leafAt(const Side& side, const glm::dvec2& texel) {
  const auto x = static_cast<std::uint32_t>(std::clamp(texel.x, 0.0, static_cast<double>(side.width - 1)));
  const auto y = static_cast<std::uint32_t>(std::clamp(texel.y, 0.0, static_cast<double>(side.height - 1)));
  return side.first_value + y * side.width + x;
}

/// Whether a ray goes on through what it met.
bool LeafRays::passes(const geometry::Hit& hit, const glm::dvec3& at, const glm::dvec3& direction,
                      std::uint64_t key) const {
  const auto& surface = patches_.surfaces[patches_.triangle_surface[hit.triangle]];
  return surface.see_through && uniformFromKey(mixKeys(key, hit.triangle)) >= stoppedPart(hit, at, direction);
}

double LeafRays::stoppedPart(const geometry::Hit& hit, const glm::dvec3& at, const glm::dvec3& direction) const {
  if (!patches_.surfaces[patches_.triangle_surface[hit.triangle]].see_through) return 1.0;
  const auto texel = texelAt(patches_.triangles[hit.triangle], at);
  return static_cast<double>(patches_.stoppedAt(hit.triangle, glm::vec2(texel), glm::vec3(direction)));
}

/// Takes from what is left what is stopped there.
void LeafRays::passThrough(const geometry::Hit& hit, const glm::dvec3& at, const glm::dvec3& direction,
                           Passage& passage) const {
  passage.part *= 1.0 - stoppedPart(hit, at, direction);
  const auto& surface = patches_.surfaces[patches_.triangle_surface[hit.triangle]];
  if (surface.first_tint == scene::kNone) return;
  passage.tint *= glm::dvec3(patches_.tintAt(surface, glm::vec2(texelAt(patches_.triangles[hit.triangle], at))));
}

void LeafRays::addPane(const geometry::Hit& hit, const glm::dvec3& at, Panes& panes) const {
  const auto& surface = patches_.surfaces[patches_.triangle_surface[hit.triangle]];
  if (surface.first_tint == scene::kNone) return;
  const auto texel = texelAt(patches_.triangles[hit.triangle], at);
  const auto cell = [](double place, std::uint32_t leaves) {
    return static_cast<std::uint32_t>(std::clamp(place, 0.0, static_cast<double>(leaves - 1)));
  };
  const auto which = surface.first_tint + cell(texel.y, surface.height) * surface.width + cell(texel.x, surface.width);
  panes.tint *= glm::dvec3(patches_.tintAt(surface, glm::vec2(texel)));
  if (patches_.leaf_tints[which] != glm::vec3(1.0F) && panes.count < Panes::kMost) panes.which[panes.count++] = which;
}

std::uint32_t LeafRays::litSideOf(const geometry::Hit& hit) const {
  const auto surface = patches_.triangle_surface[hit.triangle];
  const auto met = side_of_[surface][hit.front ? 0 : 1];
  return met == scene::kNone && patches_.surfaces[surface].glass.mirrors_back ? side_of_[surface][hit.front ? 1 : 0]
                                                                              : met;
}

void LeafRays::meetFirst(std::span<const Place> from, std::span<const glm::dvec3> directions,
                         std::span<geometry::Hit> hits) const {
  std::array<geometry::Ray, geometry::kPacket> rays;
  for (std::size_t i = 0; i < from.size(); ++i)
    rays[i] = {glm::vec3(lifted(from[i])), glm::vec3(directions[i]), static_cast<float>(kFar), from[i].triangle};
  rays_.nearest(std::span(rays).first(from.size()), hits);
}

std::uint32_t LeafRays::see(const Place& from, const glm::dvec3& direction, std::uint64_t key, Place& end,
                            const geometry::Hit* first, Panes* panes) const {
  auto origin = lifted(from);
  std::array<std::uint32_t, kMostSheets> passed;
  std::array<float, kMostSheets> distance;
  std::size_t sheets = 0, starts = 0;
  while (true) {
    auto hit = first != nullptr
                   ? *std::exchange(first, nullptr)
                   : rays_.nearest({glm::vec3(origin), glm::vec3(direction), static_cast<float>(kFar), from.triangle},
                                   std::span(passed).first(sheets));
    if (!hit.found()) return kSky + SkyCells::of(direction);
    const auto at = origin + static_cast<double>(hit.t) * direction;
    if (starts < kMostStarts && passes(hit, at, direction, key)) {
      if (panes != nullptr) addPane(hit, at, *panes);
      passed[sheets] = hit.triangle;  // those that lie in the same place count, too
      distance[sheets++] = hit.t;
      if (sheets < kMostSheets) continue;
      origin = at;
      ++starts;
      sheets = 0;
      for (std::size_t i = 0; i < kMostSheets; ++i)
        if (hit.t - distance[i] <= kSameSheet && sheets < kMostSheets / 2) passed[sheets++] = passed[i];
      for (std::size_t i = 0; i < sheets; ++i) distance[i] = 0.0F;
      continue;
    }
    auto s = litSideOf(hit);
    end = {at, {}, kNothing, hit.triangle};
    if (s == scene::kNone) return kNothing;
    auto texel = texelAt(patches_.triangles[hit.triangle], at);
    auto value = leafAt(sides_[s], texel);
    if (sheets + 1 < kMostSheets && isBeneath(sides_[s], value) &&
        uncover(hit, origin, direction, std::span(passed), sheets)) {
      s = side_of_[patches_.triangle_surface[hit.triangle]][hit.front ? 0 : 1];
      texel = texelAt(patches_.triangles[hit.triangle], at);
      value = leafAt(sides_[s], texel);
    }
    // In the plane: `at` is off by what the distance is rounded, more than rays are lifted on long thin triangles.
    const auto& frame = patches_.triangles[hit.triangle];
    end = {positionAt(frame, texel), glm::dvec3(hit.front ? frame.normal : -frame.normal), value, hit.triangle};
    return standInOf(value);
  }
}

bool LeafRays::isBeneath(const Side& side, std::uint32_t value) const {
  return patches_.leaves[patches_.surfaces[side.surface].first_leaf + value - side.first_value].beneath;
}

/// What lies in the same place as the hit and is seen there instead, if that is something: then the hit is that.
bool LeafRays::uncover(geometry::Hit& hit, const glm::dvec3& origin, const glm::dvec3& direction,
                       std::span<std::uint32_t> passed, std::size_t sheets) const {
  const geometry::Ray again{glm::vec3(origin), glm::vec3(direction), hit.t + kSameSheet};
  auto seen = hit;
  auto met = hit;
  for (passed[sheets++] = met.triangle; sheets < passed.size(); passed[sheets++] = met.triangle) {
    met = rays_.nearest(again, passed.first(sheets));
    if (!met.found()) break;
    const auto s = side_of_[patches_.triangle_surface[met.triangle]][met.front ? 0 : 1];
    if (s != scene::kNone && patches_.seenOrder(met.triangle) < patches_.seenOrder(seen.triangle)) seen = met;
  }
  return seen.triangle != std::exchange(hit, seen).triangle;
}

LeafRays::Sight LeafRays::look(const Place& from, const glm::dvec3& direction) const {
  auto sight = look(from, direction, kFar);
  if (sight.distance >= kFar) sight.end.value = kSky + SkyCells::of(direction);
  return sight;
}

bool LeafRays::isOpen(const Place& from, const glm::dvec3& to, const glm::dvec3& normal) const {
  const glm::dvec3 origin = lifted(from), way = to + kLift * normal - origin;
  const double length = glm::length(way);
  return length > kNearEnd &&
         rays_.open({glm::vec3(origin), glm::vec3(way / length), static_cast<float>(length - kNearEnd)});
}

LeafRays::Passage LeafRays::passageTo(const Place& from, const glm::dvec3& to) const {
  if (patches_.opacity.empty()) return {isOpen(from, to) ? 1.0 : 0.0};
  const glm::dvec3 origin = lifted(from), way = to - origin;
  const double length = glm::length(way);
  if (length <= kNearEnd) return {};
  const geometry::Ray ray{glm::vec3(origin), glm::vec3(way / length), static_cast<float>(length - kNearEnd),
                          from.triangle};
  std::array<std::uint32_t, kMostSheets> passed;
  Passage passage{1.0};
  for (std::size_t sheets = 0; sheets < kMostSheets; ++sheets) {
    const auto hit = rays_.nearest(ray, std::span(passed).first(sheets));
    if (!hit.found()) return passage;
    passThrough(hit, origin + static_cast<double>(hit.t) * way / length, way, passage);
    if (passage.part <= 0.0) return {};
    passed[sheets] = hit.triangle;
  }
  return {};
}

LeafRays::Arrival LeafRays::arriveAt(const Place& from, const glm::dvec3& at) const {
  const glm::dvec3 origin = lifted(from), way = at - origin;
  const double length = glm::length(way);
  if (length <= kNearEnd) return {};
  const auto direction = way / length;
  const geometry::Ray ray{glm::vec3(origin), glm::vec3(direction), static_cast<float>(length + kNearPlane),
                          from.triangle};
  std::array<std::uint32_t, kMostSheets> passed;
  Passage passage{1.0};
  Arrival beneath;
  for (std::size_t sheets = 0; sheets < kMostSheets; ++sheets) {
    const auto hit = rays_.nearest(ray, std::span(passed).first(sheets));
    const double before = length - static_cast<double>(hit.t);
    if (!hit.found() || before < -kNearPlane) break;
    const auto there = origin + static_cast<double>(hit.t) * direction;
    passed[sheets] = hit.triangle;
    const auto& frame = patches_.triangles[hit.triangle];
    const bool is_in_plane = std::abs(glm::dot(glm::dvec3(frame.normal), there - at)) <= kNearEnd;
    if (!is_in_plane || before > kNearPlane) {
      if (before < kNearEnd) break;
      passThrough(hit, there, direction, passage);
      if (passage.part <= 0.0) return {};
      continue;
    }
    const auto texel = texelAt(frame, there);
    const glm::dvec3 normal(hit.front ? frame.normal : -frame.normal);
    Arrival arrival{passage, {positionAt(frame, texel), normal, kNothing, hit.triangle}};
    arrival.passage.part *= stoppedPart(hit, there, direction);
    const auto s = litSideOf(hit);
    if (s == scene::kNone) return arrival;
    const auto value = leafAt(sides_[s], texel);
    arrival.end.value = standInOf(value);
    if (!isBeneath(sides_[s], value)) return arrival;
    if (!(beneath.passage.part > 0.0)) beneath = arrival;  // what covers it is met as well, if something does there
  }
  return beneath;
}

glm::vec3 LeafRays::startOf(const Place& place) { return glm::vec3(lifted(place)); }

void LeafRays::hide(const glm::vec3& from, const Points& points, std::int32_t* hidden) const {
  geometry::Ways ways{};
  for (std::size_t axis = 0; axis < 3; ++axis) ways.origin[axis].fill(from[static_cast<int>(axis)]);
  for (std::size_t first = 0; first < points.x.size(); first += geometry::kPacket) {
    for (std::size_t k = 0; k < geometry::kPacket; ++k) {
      ways.direction[0][k] = points.x[first + k] - from.x;
      ways.direction[1][k] = points.y[first + k] - from.y;
      ways.direction[2][k] = points.z[first + k] - from.z;
    }
    const auto open = rays_.open(ways);
    for (std::size_t k = 0; k < geometry::kPacket; ++k) hidden[first + k] = (open >> k & 1U) != 0 ? 0 : 1;
  }
}

std::optional<LeafRays::Place> LeafRays::endOn(std::uint32_t value, const Place& from,
                                               const glm::dvec3& direction) const {
  const Side& side = sideOf(value);
  const auto& surface = patches_.surfaces[side.surface];
  const auto triangle = patches_.leaves[surface.first_leaf + value - side.first_value].triangle;
  if (!is_even_[side.surface] || triangle == scene::kNone) return std::nullopt;
  const auto& frame = patches_.triangles[triangle];
  const glm::dvec3 normal(side.side == 0 ? frame.normal : -frame.normal), origin = lifted(from);
  const double slope = glm::dot(normal, direction);
  if (slope > -kLeastSlope) return std::nullopt;
  const double t = glm::dot(normal, glm::dvec3(frame.origin) - origin) / slope;
  return Place{origin + t * direction, normal, value, triangle};
}

}  // namespace radiosity::solver
