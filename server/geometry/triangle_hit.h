// Where a ray meets a triangle, in double precision. Pure function, any thread.
#pragma once

#include <glm/geometric.hpp>
#include <glm/vec3.hpp>

#include "server/geometry/bvh.h"

namespace radiosity::scene {

/// One and more than rounding.
inline constexpr double kJustAbove = 1.0 + 1e-12;

/// Moller and Trumbore 1997, in double so that edges leak less than a part in 1e12.
[[nodiscard]] inline bool meetsTriangle(const Bvh::Triangle& triangle, const glm::dvec3& origin,
                                        const glm::dvec3& direction, RayHit& hit) {
  const glm::dvec3 a(triangle[0]);
  const glm::dvec3 e1 = glm::dvec3(triangle[1]) - a;
  const glm::dvec3 e2 = glm::dvec3(triangle[2]) - a;
  const glm::dvec3 p = glm::cross(direction, e2);
  const double determinant = glm::dot(e1, p);
  if (determinant == 0.0) return false;
  const glm::dvec3 s = origin - a;
  // Most rays pass by: that is known before anything is divided.
  const double scaled = glm::dot(s, p), sign = determinant > 0.0 ? 1.0 : -1.0;
  if (scaled * sign < 0.0 || scaled * sign > kJustAbove * determinant * sign) return false;
  const double u = scaled / determinant;
  if (!(u >= 0.0 && u <= 1.0)) return false;
  const glm::dvec3 q = glm::cross(s, e1);
  const double v = glm::dot(direction, q) / determinant;
  if (!(v >= 0.0 && u + v <= 1.0)) return false;
  hit.t = glm::dot(e2, q) / determinant;
  hit.front = determinant > 0.0;
  return true;
}

}  // namespace radiosity::scene
