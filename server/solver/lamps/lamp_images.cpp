#include "server/solver/lamps/lamp_images.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "server/solver/lamps/unhidden.h"
#include "server/solver/math/polygon_form_factor.h"
#include "server/solver/math/sampling.h"
#include "server/solver/patches/unshot_pyramid.h"

namespace radiosity::solver {
namespace {

/// A place, or a lamp, nearer to the plane of a mirror than this (unit box) lies in it.
constexpr double kInPlane = 1e-5;
/// Where ways cross the plane of a mirror is known to so much of the unit box.
constexpr double kRounding = 1e-5;
/// What is so many radii away is seen as a ball would be that is not nearer on one side than on the other.
constexpr double kFewRadii = 2.0;

/// So many times as bright as if the light of all lamps came evenly from everywhere.
constexpr double kBright = 8.0;

bool isLamp(const PunctualLights::Source& source) { return source.kind != PunctualLights::Source::Kind::kSky; }

std::uint64_t keyOf(const FlatMirrors::Plane& plane) {
  const auto bits = [](double x) { return std::uint64_t{std::bit_cast<std::uint32_t>(static_cast<float>(x))}; };
  const auto normal = mixKeys(bits(plane.normal.x) << 32U | bits(plane.normal.y), bits(plane.normal.z));
  return mixKeys(normal, bits(plane.distance));
}

}  // namespace

float LampImages::leastEmission(std::span<const LightPolygon> polygons, double area) {
  double flux = 0.0;
  for (const auto& lamp : polygons) flux += lamp.area * static_cast<double>(channelSum(lamp.emission));
  return area > 0.0 ? static_cast<float>(kBright * flux / area) : 0.0F;
}

std::vector<glm::vec3> LampImages::lightOf(std::span<const LightPolygon> polygons,
                                           std::span<const PunctualLights::Source> sources) {
  std::vector<glm::vec3> light;
  for (const auto& polygon : polygons) light.push_back(polygon.emission);
  for (const auto& source : sources)
    if (isLamp(source)) light.emplace_back(source.intensity);
  return light;
}

std::shared_ptr<const LampImages> LampImages::find(const scene::PatchScene& patches, const std::vector<Side>& sides,
                                                   std::shared_ptr<const LeafRays> rays,
                                                   std::shared_ptr<const SpecularLeaves> mirrors,
                                                   std::span<const LightPolygon> polygons,
                                                   std::span<const PunctualLights::Source> sources) {
  if (!mirrors) return nullptr;
  const std::shared_ptr<LampImages> found(new LampImages());
  found->polygons_.assign(polygons.begin(), polygons.end());
  std::ranges::copy_if(sources, std::back_inserter(found->sources_), isLamp);
  if (found->lampCount() == 0 || found->lampCount() > kMostImages) return nullptr;
  found->flat_ = FlatMirrors::find(patches, sides, *mirrors, kMostImages / found->lampCount());
  if (!found->flat_) return nullptr;
  std::vector<std::uint64_t> keys;
  for (const auto& lamp : polygons) {
    found->balls_.push_back(ballOf(lamp));
    keys.push_back(lamp.key);
  }
  for (const auto& source : found->sources_) {
    found->balls_.push_back(ballOf(source));
    keys.push_back(mixKeys(source.shapeKey(), 1));
  }
  const auto& planes = found->flat_->planes();
  for (std::uint32_t lamp = 0; lamp < keys.size(); ++lamp) {
    for (std::uint32_t plane = 0; plane < planes.size(); ++plane)
      found->images_.push_back({lamp, plane, mixKeys(mixKeys(keys[lamp], keyOf(planes[plane])), mirrors->key())});
  }
  found->rays_ = std::move(rays);
  found->mirrors_ = std::move(mirrors);
  return found;
}

bool LampImages::maySee(const Image& image, const glm::dvec3& centre, double radius) const {
  const auto& plane = flat_->planes()[image.plane];
  const auto& lamp = balls_[image.lamp];
  const double height = plane.heightOf(centre), side = height < 0.0 ? -1.0 : 1.0;
  if (std::abs(height) <= kFewRadii * radius) return true;
  const auto behind = plane.mirrored(centre);
  // Where the way from the mirror image of the centre crosses the plane, and how far others cross it from there.
  glm::dvec3 crossing(0.0);
  double aside = 0.0;
  if (lamp.is_far) {
    const double rise = side * glm::dot(plane.normal, lamp.centre);
    if (rise <= -lamp.radius) return false;
    if (rise <= kFewRadii * lamp.radius) return true;
    crossing = behind + std::abs(height) / rise * lamp.centre;
    aside = radius / rise + kFewRadii * lamp.radius * std::abs(height) / (rise * rise);
  } else {
    const double above = side * plane.heightOf(lamp.centre);
    if (above <= -lamp.radius) return false;
    if (above <= kFewRadii * lamp.radius + kInPlane) return true;
    const double part = std::abs(height) / (std::abs(height) + above);
    crossing = behind + part * (lamp.centre - behind);
    const double slope = glm::length(lamp.centre - behind) / (std::abs(height) + above);
    aside = kFewRadii * slope * ((1.0 - part) * radius + part * lamp.radius);
  }
  const auto nearest = glm::clamp(crossing, plane.low, plane.high);
  return glm::distance(nearest, crossing) <= aside + kRounding;
}

LampImages::Unhidden LampImages::unhidden(std::uint32_t lamp, const LeafRays::Place& place, const glm::dvec3& shading,
                                          const glm::dvec2& at) const {
  if (lamp >= polygons_.size()) {
    const auto& source = sources_[lamp - polygons_.size()];
    auto shaded = place;
    shaded.normal = shading;
    const auto look = lookAt(source, shaded, at);
    if (glm::dot(place.normal, look.way) <= 0.0) return {};  // the surface itself hides it
    return {look.way, look.brings};
  }
  const auto& polygon = polygons_[lamp];
  const glm::dvec3 normal(polygon.normal), way = glm::dvec3(polygon.point(at.x, at.y)) - place.position;
  const double leaves = -glm::dot(normal, way), square = glm::dot(way, way);
  if (leaves <= kInPlane || glm::dot(place.normal, way) <= 0.0) return {};
  return {way, std::max(0.0, glm::dot(shading, way)) * leaves / (square * square)};
}

LeafRays::Place LampImages::behind(const FlatMirrors::Plane& plane, const LeafRays::Place& place) {
  auto mirrored = place;
  mirrored.position = plane.mirrored(place.position);
  mirrored.normal = plane.mirroredWay(place.normal);
  return mirrored;
}

LampImages::Look LampImages::look(const Image& image, const LeafRays::Place& place, const glm::dvec3& shading,
                                  const glm::dvec2& at) const {
  const auto& plane = flat_->planes()[image.plane];
  const double height = plane.heightOf(place.position);
  if (std::abs(height) <= kInPlane) return {};
  const auto behind = LampImages::behind(plane, place);
  const auto unhidden = this->unhidden(image.lamp, behind, plane.mirroredWay(shading), at);
  Look look{unhidden.weight, glm::dvec3(0.0)};
  if (!(look.weight > 0.0)) return look;
  const double rise = (height < 0.0 ? -1.0 : 1.0) * glm::dot(plane.normal, unhidden.way);
  if (rise <= std::abs(height) + kInPlane) return look;  // the lamp is on the other side
  const auto crossing = behind.position + std::abs(height) / rise * unhidden.way;
  const auto nearest = glm::clamp(crossing, plane.low, plane.high);
  if (glm::distance(nearest, crossing) > kRounding) return look;
  const auto arrival = rays_->arriveAt(place, crossing);
  if (!(arrival.passage.part > 0.0) || arrival.end.value == LeafRays::kNothing ||
      flat_->planeOf(arrival.end.value) != image.plane)
    return look;
  const auto open = rays_->passageTo(arrival.end, behind.position + unhidden.way);
  if (open.part <= 0.0) return look;
  const double cosine = rise / glm::length(unhidden.way);
  const auto edge = scene::GlassFace::edgeOf(static_cast<float>(cosine));
  look.seen =
      look.weight * arrival.passage.light() * open.light() * glm::dvec3(mirrors_->reflectance(arrival.end.value, edge));
  return look;
}

glm::dvec3 LampImages::irradiance(const Image& image, const Looks& looks, std::span<const LeafRays::Place> places,
                                  const glm::dvec3* shading) const {
  if (looks.seen_count == 0) return glm::dvec3(0.0);
  if (image.lamp >= polygons_.size()) return looks.seen / static_cast<double>(looks.count);
  const auto& plane = flat_->planes()[image.plane];
  const auto& polygon = polygons_[image.lamp];
  const std::span corners(polygon.corners.data(), polygon.corner_count);
  double sum = 0.0;
  for (const auto& place : places) {
    const auto [position, normal, value, triangle] = behind(plane, place);
    if (glm::dot(position - glm::dvec3(corners[0]), glm::dvec3(polygon.normal)) <= kInPlane) continue;
    sum += shading == nullptr ? polygonFormFactor(position, normal, corners)
                              : formFactorsAboveBoth(position, normal, plane.mirroredWay(*shading), corners).shading;
  }
  return sum / static_cast<double>(places.size()) * (looks.seen / looks.weight);
}

}  // namespace radiosity::solver
