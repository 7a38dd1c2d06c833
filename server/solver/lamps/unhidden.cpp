#include "server/solver/lamps/unhidden.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <span>

#include "server/solver/math/polygon_form_factor.h"

namespace radiosity::solver {
namespace {

/// Nearer to a lamp's plane than this (unit box) is on it.
constexpr double kOnLamp = 1e-6;
/// Light from directions without an end comes from there.
constexpr double kEndless = 4.0;

using SourceKind = PunctualLights::Source::Kind;

/// To one without a size.
glm::dvec3 wayTo(const PunctualLights::Source& source, const LeafRays::Place& place) {
  if (source.kind == SourceKind::kDirectional) return kEndless * glm::dvec3(source.direction);
  return glm::dvec3(source.position) - place.position;
}

}  // namespace

double unhiddenLight(const LightPolygon& lamp, const LeafRays::Place& place) {
  if (glm::dot(place.position - glm::dvec3(lamp.corners[0]), glm::dvec3(lamp.normal)) <= kOnLamp) return 0.0;
  return polygonFormFactor(place.position, place.normal, std::span(lamp.corners.data(), lamp.corner_count));
}

SourceLook lookAt(const PunctualLights::Source& source, const LeafRays::Place& place, const glm::dvec2& at) {
  if (source.kind == SourceKind::kLamp) {
    const auto point = lampPoint(source.lamp(), place.position, place.normal, at);
    return {point.position - place.position, point.brings};
  }
  return {wayTo(source, place), unhiddenSource(source, place)};
}

double unhiddenSource(const PunctualLights::Source& source, const LeafRays::Place& place) {
  if (source.kind == SourceKind::kSky) return 0.0;
  if (source.kind == SourceKind::kLamp) return wholeIrradiance(source.lamp(), place.position, place.normal);
  const glm::dvec3 way = wayTo(source, place), axis(source.direction);
  const double distance = glm::length(way), cosine = distance > 0.0 ? glm::dot(place.normal, way) / distance : 0.0;
  if (cosine <= 0.0 || source.kind == SourceKind::kDirectional) return std::max(0.0, cosine);
  double strength = 1.0;
  if (source.kind == SourceKind::kSpot) {
    const double fade = std::clamp(-glm::dot(axis, way) / distance * static_cast<double>(source.cone_scale) +
                                       static_cast<double>(source.cone_offset),
                                   0.0, 1.0);
    strength = fade * fade;
  }
  if (source.range > 0.0F)
    strength *= std::clamp(1.0 - std::pow(distance / static_cast<double>(source.range), 4.0), 0.0, 1.0);
  return strength * cosine / (distance * distance);
}

}  // namespace radiosity::solver
