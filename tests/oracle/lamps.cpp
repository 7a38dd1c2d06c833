#include "tests/oracle/lamps.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>

namespace radiosity::oracle {

LampLight lightOf(const Lamp& lamp, const glm::dvec3& position, const glm::dvec3& normal) {
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

}  // namespace radiosity::oracle
