#include "server/solver/transport/lamp_shape.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/scene/values/light_web.h"
#include "server/scene/values/sky_table.h"
#include "server/solver/math/lamp_form_factor.h"
#include "server/solver/math/polygon_form_factor.h"

namespace radiosity::solver {
namespace {

using Kind = LampShape::Kind;

constexpr double kPi = std::numbers::pi;
constexpr float kDegrees = static_cast<float>(180.0 / std::numbers::pi);
/// Nearer to the plane of a flat lamp than this (unit box) is behind it.
constexpr double kInPlane = 1e-6;
/// A flat lamp whose half diagonal is less than this part of its distance is a point: to a millionth, where the sums of
/// the closed forms would cancel.
constexpr double kSmall = 1e-3;
/// Points of what is far lie so far from a place: twice as far as the unit box is wide.
constexpr double kFar = 4.0;

glm::dvec3 perpendicularTo(const glm::dvec3& axis) {
  const glm::dvec3 helper = std::abs(axis.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  return glm::normalize(glm::cross(helper, axis));
}

/// At an angle of this cosine from the axis, `turns` about it.
glm::dvec3 around(const glm::dvec3& axis, double cosine, double turns) {
  const double sine = std::sqrt(std::max(0.0, 1.0 - cosine * cosine)), angle = 2.0 * kPi * turns;
  const auto s = perpendicularTo(axis), t = glm::cross(axis, s);
  return cosine * axis + sine * (std::cos(angle) * s + std::sin(angle) * t);
}

double areaOf(const LampShape& shape) {
  const auto width = static_cast<double>(shape.half.x), height = static_cast<double>(shape.half.y);
  return shape.kind == Kind::kRectangle ? 4.0 * width * height : kPi * width * width;
}

std::array<glm::vec3, 4> cornersOf(const LampShape& shape) {
  const auto u = shape.half.x * shape.across, v = shape.half.y * glm::cross(shape.axis, shape.across);
  return {shape.centre - u - v, shape.centre + u - v, shape.centre + u + v, shape.centre - u + v};
}

/// Directions are spread evenly over the solid angle in which the ball is seen.
LampPoint ballPoint(const Lamp& lamp, const glm::dvec3& place, const glm::dvec3& normal, const glm::dvec2& at) {
  const auto way = glm::dvec3(lamp.shape.centre) - place;
  const double distance = glm::length(way), radius = static_cast<double>(lamp.shape.half.x);
  if (!(distance > 0.0)) return {place, 0.0};
  const double sine = std::min(1.0, radius / distance);
  const double least = std::sqrt(std::max(0.0, 1.0 - sine * sine)), part = sine * sine / (1.0 + least);  // 1 - least
  const auto direction = around(way / distance, 1.0 - at.x * part, at.y);
  const double along = glm::dot(way, direction);
  const double half = std::sqrt(std::max(0.0, radius * radius - std::max(0.0, distance * distance - along * along)));
  const double solid_angle = 2.0 * kPi * part;
  const double brings = std::max(0.0, glm::dot(normal, direction)) * solid_angle / (kPi * radius * radius);
  return {place + std::max(0.0, along - half) * direction, brings * lamp.fade(distance)};
}

/// As if all of the lamp were there.
LampPoint pointAt(const Lamp& lamp, const glm::dvec3& place, const glm::dvec3& normal, const glm::dvec3& point) {
  const auto way = point - place;
  const double square = glm::dot(way, way), distance = std::sqrt(square);
  const double arrives = glm::dot(normal, way);
  if (!(arrives > 0.0)) return {point, 0.0};
  const auto strength = static_cast<double>(lamp.strength(glm::vec3(-way / distance)));
  return {point, strength * arrives / (distance * square) * lamp.fade(distance)};
}

/// Directions are spread evenly over the solid angle in which a sun is seen.
LampPoint sunPoint(const LampShape& shape, const glm::dvec3& place, const glm::dvec3& normal, const glm::dvec2& at) {
  const auto sine = static_cast<double>(shape.half.x);
  const double part = sine * sine / (1.0 + std::sqrt(1.0 - sine * sine));  // 1 - cosine of its radius
  const auto direction = around(glm::dvec3(shape.axis), 1.0 - at.x * part, at.y);
  const double brings = 2.0 * part / (sine * sine);
  return {place + kFar * direction, std::max(0.0, glm::dot(normal, direction)) * brings};
}

/// From the directions of a sky's table to those of the scene.
glm::dvec3 turned(const LampShape& shape, const glm::dvec3& direction) {
  const auto cosine = static_cast<double>(shape.across.x), sine = static_cast<double>(shape.across.z);
  return {cosine * direction.x - sine * direction.z, direction.y, sine * direction.x + cosine * direction.z};
}

/// Directions are drawn in proportion to the light that comes from there.
LampPoint skyPoint(const Lamp& lamp, const glm::dvec3& place, const glm::dvec3& normal, const glm::dvec2& at) {
  const auto direction = turned(lamp.shape, scene::skyDirection(lamp.web, at));
  return {place + kFar * direction, std::max(0.0, glm::dot(normal, direction))};
}

LampPoint flatPoint(const Lamp& lamp, const glm::dvec3& place, const glm::dvec3& normal, const glm::dvec2& at) {
  const auto& shape = lamp.shape;
  return pointAt(lamp, place, normal, shape.kind == Kind::kWeb ? glm::dvec3(shape.centre) : shape.pointOn(at));
}

}  // namespace

glm::dvec3 LampShape::pointOn(const glm::dvec2& at) const {
  const glm::dvec3 middle(centre), x(across), y = glm::cross(glm::dvec3(axis), x);
  const auto width = static_cast<double>(half.x), height = static_cast<double>(half.y);
  if (kind == Kind::kRectangle) return middle + (2.0 * at.x - 1.0) * width * x + (2.0 * at.y - 1.0) * height * y;
  const double r = width * std::sqrt(at.x), angle = 2.0 * kPi * at.y;
  return middle + r * (std::cos(angle) * x + std::sin(angle) * y);
}

float LampShape::reach() const { return kind == Kind::kWeb ? 0.0F : std::hypot(half.x, half.y); }

float Lamp::strength(const glm::vec3& direction) const {
  const float cosine = std::clamp(glm::dot(shape.axis, direction), -1.0F, 1.0F);
  if (shape.kind == Kind::kBall) return 1.0F;
  if (shape.isFlat()) return std::max(0.0F, cosine);
  if (shape.kind == Kind::kSpotDisc) {
    const float ramp = std::clamp(cosine * shape.cone_scale + shape.cone_offset, 0.0F, 1.0F);
    return cosine > 0.0F ? ramp * ramp : 0.0F;
  }
  const float x = glm::dot(shape.across, direction), y = glm::dot(glm::cross(shape.across, shape.axis), direction);
  // Near the axis the cosine hardly tells the angle.
  const float polar = std::atan2(std::hypot(x, y), cosine), azimuth = std::atan2(y, x);
  return scene::webCandela(web, std::min(kDegrees * polar, 180.0F), kDegrees * azimuth);
}

double Lamp::fade(double distance) const {
  if (shape.range <= 0.0F) return 1.0;
  return std::clamp(1.0 - std::pow(distance / static_cast<double>(shape.range), 4.0), 0.0, 1.0);
}

double wholeIrradiance(const Lamp& lamp, const glm::dvec3& place, const glm::dvec3& normal) {
  const auto& shape = lamp.shape;
  if (shape.kind == Kind::kSun) {
    const auto sine = static_cast<double>(shape.half.x);
    return ballFormFactor(glm::dvec3(0.0), normal, glm::dvec3(shape.axis), sine) / (sine * sine);
  }
  if (shape.kind == Kind::kSky) {
    const auto mean = turned(shape, scene::meanSkyDirection(lamp.web));
    return std::max(0.0, glm::dot(normal, mean)) + 0.25 * std::max(0.0, 1.0 - glm::length(mean));
  }
  const glm::dvec3 centre(shape.centre), axis(shape.axis);
  if (shape.kind == Kind::kBall) {
    const auto radius = static_cast<double>(shape.half.x);
    const double factor = ballFormFactor(place, normal, centre, radius) / (radius * radius);
    return factor * lamp.fade(glm::distance(place, centre));
  }
  const bool is_small = static_cast<double>(shape.reach()) < kSmall * glm::distance(place, centre);
  if (is_small || !shape.hasClosedForm()) return pointAt(lamp, place, normal, centre).brings;
  if (glm::dot(place - centre, axis) <= kInPlane) return 0.0;
  const double factor = shape.kind == Kind::kDisc
                            ? discFormFactor(place, normal, centre, axis, static_cast<double>(shape.half.x))
                            : polygonFormFactor(place, normal, cornersOf(shape));
  return kPi * factor / areaOf(shape) * lamp.fade(glm::distance(place, centre));
}

LampPoint lampPoint(const Lamp& lamp, const glm::dvec3& place, const glm::dvec3& normal, const glm::dvec2& at) {
  if (lamp.shape.kind == Kind::kSun) return sunPoint(lamp.shape, place, normal, at);
  if (lamp.shape.kind == Kind::kSky) return skyPoint(lamp, place, normal, at);
  return lamp.shape.kind == Kind::kBall ? ballPoint(lamp, place, normal, at) : flatPoint(lamp, place, normal, at);
}

LampRay lampRay(const Lamp& lamp, const std::array<double, 4>& at) {
  const auto& shape = lamp.shape;
  const glm::dvec3 axis(shape.axis), up(0.0, 1.0, 0.0);
  LampRay ray;
  if (shape.isFar()) {
    const auto point = lampPoint(lamp, glm::dvec3(0.0), glm::dvec3(0.0), {at[0], at[1]}).position / kFar;
    return {glm::vec3(point), glm::vec3(-point), 1.0};
  }
  if (shape.kind == Kind::kBall) {
    const auto direction = around(up, 1.0 - 2.0 * at[0], at[1]);
    const auto from = around(direction, std::sqrt(1.0 - at[2]), at[3]);  // by the cosine with the ball's normal
    return {shape.centre + shape.half.x * glm::vec3(from), glm::vec3(direction), 1.0};
  }
  ray.origin = glm::vec3(shape.pointOn({at[2], at[3]}));
  if (shape.kind != Kind::kSpotDisc) return {ray.origin, glm::vec3(around(axis, std::sqrt(1.0 - at[0]), at[1])), 1.0};
  const auto least = shape.cone_scale > 0.0F ? std::clamp(-shape.cone_offset / shape.cone_scale, 0.0F, 1.0F) : 0.0F;
  ray.direction = glm::vec3(around(axis, 1.0 - at[0] * (1.0 - static_cast<double>(least)), at[1]));
  ray.weight = static_cast<double>(lamp.strength(ray.direction));
  return ray;
}

double lampFlux(const LampShape& shape, double web_lumens) {
  if (shape.kind == Kind::kWeb) return web_lumens;
  return shape.kind == Kind::kBall ? 4.0 * kPi : kPi;
}

float LampLooks::irradiance(std::uint32_t looks) const {
  if (seen_ == 0 || looks == 0) return 0.0F;
  const auto seen = static_cast<float>(seen_), asked = static_cast<float>(asked_);
  // Of each look that was asked the others tell; of one alone it does itself.
  const float others = asked_ > 1 ? (seen * lacking_ - lacking_seen_) / (asked - 1.0F) : lacking_seen_;
  return std::max(0.0F, brought_ + others + seen / asked * beside_) / static_cast<float>(looks);
}

}  // namespace radiosity::solver
