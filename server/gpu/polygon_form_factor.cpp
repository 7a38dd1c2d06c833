#include "server/gpu/polygon_form_factor.h"

#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/check.h"

namespace radiosity::gpu {
namespace {

/// A convex polygon clipped by one plane has at most one corner more.
struct Polygon {
  std::array<glm::dvec3, 16> corner;
  std::size_t count = 0;
};

Polygon clipToHorizon(const glm::dvec3& point, const glm::dvec3& normal, std::span<const glm::vec3> corners) {
  Polygon clipped;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto a = glm::dvec3(corners[i]) - point;
    const auto b = glm::dvec3(corners[(i + 1) % corners.size()]) - point;
    const double height_a = glm::dot(a, normal);
    const double height_b = glm::dot(b, normal);
    if (height_a >= 0.0) clipped.corner[clipped.count++] = a;
    if ((height_a < 0.0) != (height_b < 0.0) && height_a != 0.0 && height_b != 0.0) {
      clipped.corner[clipped.count++] = a + (b - a) * (height_a / (height_a - height_b));
    }
  }
  return clipped;
}

}  // namespace

double polygonFormFactor(const glm::dvec3& point, const glm::dvec3& normal, std::span<const glm::vec3> corners) {
  RAD_CHECK_LE(corners.size(), std::size_t{8});
  const auto polygon = clipToHorizon(point, normal, corners);
  if (polygon.count < 3) return 0.0;
  double sum = 0.0;
  for (std::size_t i = 0; i < polygon.count; ++i) {
    const auto& a = polygon.corner[i];
    const auto& b = polygon.corner[(i + 1) % polygon.count];
    const auto normal_of_edge = glm::cross(a, b);
    const double sine = glm::length(normal_of_edge);
    if (sine == 0.0) continue;  // the edge points at the receiver: no angle, or the receiver lies on it
    sum += std::atan2(sine, glm::dot(a, b)) * (glm::dot(normal_of_edge, normal) / sine);
  }
  return std::abs(sum) / (2.0 * std::numbers::pi);
}

}  // namespace radiosity::gpu
