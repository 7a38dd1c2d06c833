#include "tests/oracle/lamps.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

namespace radiosity::oracle {

namespace {

/// A point of a lamp with a size, as a lamp of the same flux there; `facing`: it shines by the cosine with this, or
/// evenly where that is 0.
struct Piece {
  Lamp lamp;
  glm::dvec3 facing{0.0};
};

glm::dvec3 onDisc(const Lamp& lamp, double u, double v) {
  const auto helper = std::abs(lamp.direction.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const auto s = glm::normalize(glm::cross(helper, lamp.direction)), t = glm::cross(lamp.direction, s);
  const double r = lamp.radius * std::sqrt(u), angle = 2.0 * std::numbers::pi * v;
  return lamp.position + r * (std::cos(angle) * s + std::sin(angle) * t);
}

Piece pieceOf(const Lamp& lamp, double u, double v) {
  using Kind = Lamp::Kind;
  Piece piece{lamp, {}};
  if (lamp.kind == Kind::kRectangle) {
    piece.lamp.position += (2.0 * u - 1.0) * lamp.half_u + (2.0 * v - 1.0) * lamp.half_v;
    piece.lamp.intensity *= 4.0 * glm::length(lamp.half_u) * glm::length(lamp.half_v);
    piece.facing = lamp.direction;
  } else if (lamp.kind == Kind::kDisc) {
    piece.lamp.position = onDisc(lamp, u, v);
    piece.lamp.intensity *= std::numbers::pi * lamp.radius * lamp.radius;
    piece.facing = lamp.direction;
  } else if (lamp.kind == Kind::kSpot) {
    piece.lamp.position = onDisc(lamp, u, v);
  } else if (lamp.kind == Kind::kPoint) {
    const double z = 2.0 * u - 1.0, r = std::sqrt(std::max(0.0, 1.0 - z * z)), angle = 2.0 * std::numbers::pi * v;
    piece.facing = {r * std::cos(angle), r * std::sin(angle), z};
    piece.lamp.position += lamp.radius * piece.facing;
    piece.lamp.intensity *= 4.0;  // four times as much area as one sees
  }
  return piece;
}

LampLight lightOfPoint(const Lamp& lamp, const glm::dvec3& position, const glm::dvec3& normal) {
  LampLight light;
  if (lamp.kind == Lamp::Kind::kSun) {
    light.direction = -lamp.direction;
    light.distance = std::numeric_limits<double>::infinity();
    light.irradiance = lamp.intensity * std::max(0.0, glm::dot(light.direction, normal));
    return light;
  }
  const auto way = lamp.position - position;
  light.distance = glm::length(way);
  light.direction = way / light.distance;
  double strength = std::max(0.0, glm::dot(light.direction, normal)) / (light.distance * light.distance);
  if (lamp.range > 0.0) strength *= std::clamp(1.0 - std::pow(light.distance / lamp.range, 4.0), 0.0, 1.0);
  if (lamp.kind == Lamp::Kind::kSpot) {
    const double outer = std::cos(lamp.outer_rad);
    const double ramp = std::max(0.001, std::cos(lamp.inner_rad) - outer);
    const double fade = (-glm::dot(lamp.direction, light.direction) - outer) / ramp;
    strength *= std::pow(std::clamp(fade, 0.0, 1.0), 2.0);
  }
  light.irradiance = strength * lamp.intensity;
  return light;
}

}  // namespace

LampLight lightOf(const Lamp& lamp, const glm::dvec3& position, const glm::dvec3& normal, double u, double v) {
  const bool has_size = lamp.radius > 0.0 || lamp.kind == Lamp::Kind::kRectangle;
  if (!has_size || lamp.kind == Lamp::Kind::kSun) return lightOfPoint(lamp, position, normal);
  const auto piece = pieceOf(lamp, u, v);
  auto light = lightOfPoint(piece.lamp, position, normal);
  if (piece.facing != glm::dvec3(0.0)) light.irradiance *= std::max(0.0, -glm::dot(piece.facing, light.direction));
  return light;
}

}  // namespace radiosity::oracle
