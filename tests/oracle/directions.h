// Directions that the oracle looks in.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/vec3.hpp>
#include <numbers>

namespace radiosity::oracle {

/// Two unit vectors at right angles to a unit normal and to each other (Duff et al., JCGT 2017).
inline std::array<glm::dvec3, 2> tangents(const glm::dvec3& n) {
  const double sign = std::copysign(1.0, n.z);
  const double a = -1.0 / (sign + n.z);
  const double b = n.x * n.y * a;
  return {glm::dvec3(1.0 + sign * n.x * n.x * a, sign * b, -sign * n.x), glm::dvec3(b, sign + n.y * n.y * a, -n.y)};
}

/// Cosine-distributed about a unit normal, from two numbers in [0, 1).
inline glm::dvec3 cosineDirection(const glm::dvec3& n, double u, double v) {
  const auto [s, t] = tangents(n);
  const double r = std::sqrt(u);
  const double phi = 2.0 * std::numbers::pi * v;
  return s * (r * std::cos(phi)) + t * (r * std::sin(phi)) + n * std::sqrt(std::max(0.0, 1.0 - u));
}

}  // namespace radiosity::oracle
