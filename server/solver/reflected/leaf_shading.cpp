#include "server/solver/reflected/leaf_shading.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "server/solver/math/polygon_form_factor.h"

namespace radiosity::solver {
namespace {

/// A polygon this small beside its distance, and this many times its size above both horizons, is as good as its
/// middle: a thousandth or two.
constexpr double kSmall = 0.05, kHigh = 8.0;

/// What a place receives, up to a factor that both have in common.
struct Received {
  double geometric = 0.0, shading = 0.0;
  void add(const Received& other) {
    geometric += other.geometric;
    shading += other.shading;
  }
};

/// From a direction of any length.
Received along(const ShadedPlace& place, const glm::dvec3& direction, double weight) {
  const double cosine = glm::dot(place.geometric, direction);
  if (cosine <= 0.0) return {};
  return {weight * cosine, weight * std::max(0.0, glm::dot(place.shading, direction))};
}

Received fromPolygon(const ShadedPlace& place, const ShadingEmitter& emitter, double radius, double area) {
  const auto way = emitter.at - place.position;
  const double distance = glm::length(way);
  const double height = std::min(glm::dot(place.geometric, way), glm::dot(place.shading, way));
  if (radius < kSmall * distance && height > kHigh * radius) {
    const auto facing = glm::cross(glm::dvec3(emitter.corners[1] - emitter.corners[0]),
                                   glm::dvec3(emitter.corners[2] - emitter.corners[0]));
    const double cosine = std::abs(glm::dot(glm::normalize(facing), way)), square = distance * distance;
    return along(place, way, area * cosine / (square * square));
  }
  const auto factors = formFactorsAboveBoth(place.position, place.geometric, place.shading, emitter.corners);
  constexpr double kPi = 3.14159265358979323846;
  return {kPi * factors.geometric, kPi * factors.shading};
}

Received fromPatches(const ShadedPlace& place, std::span<const ShadingEmitter::Patch> patches) {
  Received sum;
  for (const auto& patch : patches) {
    const auto way = patch.position - place.position;
    const double square = glm::dot(way, way), cosine = -glm::dot(patch.normal, way);
    if (square > 0.0 && cosine > 0.0) sum.add(along(place, way, patch.area * cosine / (square * square)));
  }
  return sum;
}

/// As if nothing hid any of it: of the part above the horizon of the one normal, so much is above both.
Received fromSky(const ShadedPlace& place, const glm::dvec3& axis) {
  const double both = 0.5 * (1.0 + glm::dot(place.geometric, place.shading));
  return {1.0 + glm::dot(axis, place.geometric), both * (1.0 + glm::dot(axis, place.shading))};
}

}  // namespace

LeafShading::LeafShading(const scene::PatchScene& patches, const std::vector<Side>& sides,
                         std::shared_ptr<const scene::ShadingNormals> normals)
    : patches_(&patches), sides_(&sides), normals_(std::move(normals)) {
  if (!normals_ || normals_->empty()) return;
  for (std::uint32_t s = 0; s < sides.size(); ++s) {
    const auto& side = sides[s];
    const auto& surface = patches.surfaces[side.surface];
    bool has = false;
    for (std::uint32_t t = 0; t < surface.triangle_count && !has; ++t) has = normals_->has(surface.first_triangle + t);
    if (!has) continue;
    shaded_.push_back({s, static_cast<std::uint32_t>(normal_.size())});
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) normal_.push_back(normalOf(side, leaf));
  }
}

ShadedPlace LeafShading::place(const Side& side, const scene::LeafSpot& spot) const {
  const auto& frame = patches_->triangles[spot.triangle];
  const glm::dvec3 geometric(frame.normal), shading = normals_->at(spot.triangle, spot.texel, geometric);
  const double facing = side.side == 0 ? 1.0 : -1.0;
  const glm::dvec3 position = glm::dvec3(frame.origin) + static_cast<double>(spot.texel.x) * glm::dvec3(frame.du) +
                              static_cast<double>(spot.texel.y) * glm::dvec3(frame.dv);
  return {position, facing * geometric, facing * shading};
}

std::size_t LeafShading::places(const Side& side, std::uint32_t leaf,
                                std::span<ShadedPlace, kMostPlaces> places) const {
  const auto& point = patches_->leaves[patches_->surfaces[side.surface].first_leaf + leaf];
  if (point.triangle == scene::kNone || patches_->node_area[side.first_node + leaf] <= 0.0F) return 0;
  if (point.full || !point.hasSpots()) {
    places[0] = place(side, {point.texel, point.triangle});
    return 1;
  }
  const std::size_t all = patches_->spotCount(point), count = std::min(all, kMostPlaces);
  for (std::size_t k = 0; k < count; ++k)
    places[k] = place(side, patches_->spot(point, static_cast<std::uint32_t>((2 * k + 1) * all / (2 * count))));
  return count;
}

/// 0 where no place has another than its own.
glm::vec3 LeafShading::normalOf(const Side& side, std::uint32_t leaf) const {
  std::array<ShadedPlace, kMostPlaces> at;
  const auto count = places(side, leaf, at);
  glm::dvec3 sum(0.0);
  bool differs = false;
  for (std::size_t k = 0; k < count; ++k) {
    sum += at[k].shading;
    differs = differs || at[k].shading != at[k].geometric;
  }
  return differs && glm::length(sum) > 0.0 ? glm::vec3(glm::normalize(sum)) : glm::vec3(0.0F);
}

std::uint32_t LeafShading::numberOf(std::uint32_t value) const {
  const auto after = std::ranges::upper_bound(
      shaded_, value, {}, [&](const ShadedSide& shaded) { return (*sides_)[shaded.side].first_value; });
  if (after == shaded_.begin()) return scene::kNone;
  const auto& shaded = *(after - 1);
  const auto& side = (*sides_)[shaded.side];
  if (value >= side.first_value + side.leaf_count) return scene::kNone;
  const auto number = shaded.first + (value - side.first_value);
  return normal_[number] == glm::vec3(0.0F) ? scene::kNone : number;
}

double shadedPart(const ShadingEmitter& emitter, std::span<const ShadedPlace> places) {
  using Kind = ShadingEmitter::Kind;
  double radius = 0.0, area = 0.0;
  if (emitter.kind == Kind::kPolygon) {
    for (const auto& corner : emitter.corners) radius = std::max(radius, glm::distance(glm::dvec3(corner), emitter.at));
    area = polygonArea(emitter.corners);
  }
  Received sum;
  for (const auto& place : places) {
    switch (emitter.kind) {
      case Kind::kPolygon:
        sum.add(fromPolygon(place, emitter, radius, area));
        break;
      case Kind::kPoint: {
        const auto way = emitter.at - place.position;
        const double distance = glm::length(way);
        if (distance > 0.0) sum.add(along(place, way, 1.0 / (distance * distance * distance)));
        break;
      }
      case Kind::kDirection:
        sum.add(along(place, emitter.at, 1.0));
        break;
      case Kind::kSky:
        sum.add(fromSky(place, emitter.at));
        break;
      case Kind::kPatches:
        sum.add(fromPatches(place, emitter.patches));
        break;
      case Kind::kDirections:
        for (const auto& patch : emitter.patches) sum.add(along(place, patch.position, patch.area));
        break;
    }
  }
  return sum.geometric > 0.0 ? sum.shading / sum.geometric : 1.0;
}

}  // namespace radiosity::solver
