#include "server/solver/probes/lamp_harmonics.h"

#include <algorithm>
#include <glm/geometric.hpp>
#include <numbers>
#include <span>

#include "server/solver/lamps/unhidden.h"

namespace radiosity::solver {
namespace {

/// Nearer to a lamp's plane, or to a point, than this (unit box) nothing arrives.
constexpr double kOnLamp = 1e-6;

}  // namespace

LampGlimpse glimpse(const LightPolygon& lamp, const glm::dvec3& place, const glm::dvec2& at) {
  LampGlimpse seen{glm::dvec3(lamp.point(at.x, at.y)), glm::dvec3(lamp.normal), {}, 0.0};
  const auto way = seen.point - place;
  const double leaves = -glm::dot(seen.normal, way), square = glm::dot(way, way);
  if (leaves <= kOnLamp) return seen;
  seen.way = way / std::sqrt(square);
  seen.weight = lamp.area * leaves / (std::numbers::pi * square * std::sqrt(square));
  return seen;
}

/// Where it is does not depend on the normal that lookAt() is told, which the second call turns towards it.
LampGlimpse glimpse(const PunctualLights::Source& source, const glm::dvec3& place, const glm::dvec2& at) {
  LampGlimpse seen;
  LeafRays::Place receiver{place, glm::dvec3(0.0, 1.0, 0.0)};
  const auto way = lookAt(source, receiver, at).way;
  const double distance = glm::length(way);
  if (!(distance > kOnLamp)) return seen;
  seen.point = place + way;
  seen.way = receiver.normal = way / distance;
  seen.weight = std::max(0.0, lookAt(source, receiver, at).brings);
  return seen;
}

std::array<double, kHarmonics> unhiddenHarmonics(const LightPolygon& lamp, const glm::dvec3& place) {
  if (glm::dot(place - glm::dvec3(lamp.corners[0]), glm::dvec3(lamp.normal)) <= kOnLamp) return {};
  auto harmonics = polygonHarmonics(place, std::span(lamp.corners.data(), lamp.corner_count));
  for (auto& of : harmonics) of /= std::numbers::pi;
  return harmonics;
}

}  // namespace radiosity::solver
