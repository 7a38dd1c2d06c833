#include "server/solver/math/polygon_form_factor.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/check.h"

namespace radiosity::solver {
namespace {

/// A convex polygon clipped by one plane has at most one corner more.
struct Polygon {
  std::array<glm::dvec3, 16> corner;
  std::size_t count = 0;
};

template <typename Corners>
Polygon clipToHorizon(const glm::dvec3& point, const glm::dvec3& normal, const Corners& corners, std::size_t count) {
  Polygon clipped;
  for (std::size_t i = 0; i < count; ++i) {
    const auto a = glm::dvec3(corners[i]) - point;
    const auto b = glm::dvec3(corners[(i + 1) % count]) - point;
    const double height_a = glm::dot(a, normal);
    const double height_b = glm::dot(b, normal);
    if (height_a >= 0.0) clipped.corner[clipped.count++] = a;
    if ((height_a < 0.0) != (height_b < 0.0) && height_a != 0.0 && height_b != 0.0) {
      clipped.corner[clipped.count++] = a + (b - a) * (height_a / (height_a - height_b));
    }
  }
  return clipped;
}

/// Whose product with a normal is 2 pi times the form factor, but for its sign (Lambert 1760).
glm::dvec3 edgeSum(const Polygon& polygon) {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 0; i < polygon.count; ++i) {
    const auto& a = polygon.corner[i];
    const auto& b = polygon.corner[(i + 1) % polygon.count];
    const auto normal_of_edge = glm::cross(a, b);
    const double sine = glm::length(normal_of_edge);
    if (sine > 0.0) sum += (std::atan2(sine, glm::dot(a, b)) / sine) * normal_of_edge;
  }
  return sum;
}

/// Fan of triangles from the first corner: exact for convex ones.
template <typename Corners>
double areaOf(const Corners& corner, std::size_t count) {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 2; i < count; ++i) {
    const auto first = glm::dvec3(corner[0]);
    sum += glm::cross(glm::dvec3(corner[i - 1]) - first, glm::dvec3(corner[i]) - first);
  }
  return 0.5 * glm::length(sum);
}

}  // namespace

double polygonArea(std::span<const glm::vec3> corners) { return areaOf(corners, corners.size()); }

CornersAbove cornersAbove(const glm::dvec3& point, const glm::dvec3& normal, std::span<const glm::vec3> corners) {
  RAD_CHECK_LE(corners.size(), std::size_t{8});
  const auto clipped = clipToHorizon(point, normal, corners, corners.size());
  CornersAbove above;
  above.count = clipped.count;
  for (std::size_t i = 0; i < clipped.count; ++i) above.corner[i] = glm::vec3(point + clipped.corner[i]);
  return above;
}

FormFactor formFactorInFront(const glm::dvec3& point, const glm::dvec3& normal, std::span<const glm::vec3> corners) {
  RAD_CHECK_LE(corners.size(), std::size_t{8});
  const auto polygon = clipToHorizon(point, normal, corners, corners.size());
  if (polygon.count < 3) return {};
  double sum = 0.0;
  for (std::size_t i = 0; i < polygon.count; ++i) {
    const auto& a = polygon.corner[i];
    const auto& b = polygon.corner[(i + 1) % polygon.count];
    const auto normal_of_edge = glm::cross(a, b);
    const double sine = glm::length(normal_of_edge);
    if (sine == 0.0) continue;  // the edge points at the receiver: no angle, or the receiver lies on it
    sum += std::atan2(sine, glm::dot(a, b)) * (glm::dot(normal_of_edge, normal) / sine);
  }
  const auto above = [&](const glm::vec3& corner) { return glm::dot(glm::dvec3(corner) - point, normal) >= 0.0; };
  const double all = std::all_of(corners.begin(), corners.end(), above) ? 0.0 : polygonArea(corners);
  const double front = all > 0.0 ? std::min(1.0, areaOf(polygon.corner, polygon.count) / all) : 1.0;
  return {std::abs(sum) / (2.0 * std::numbers::pi), front};
}

FormFactorsAboveBoth formFactorsAboveBoth(const glm::dvec3& point, const glm::dvec3& geometric,
                                          const glm::dvec3& shading, std::span<const glm::vec3> corners) {
  RAD_CHECK_LE(corners.size(), std::size_t{8});
  const auto above = clipToHorizon(point, geometric, corners, corners.size());
  if (above.count < 3) return {};
  const auto of_above = edgeSum(above);
  const auto both = clipToHorizon(glm::dvec3(0.0), shading, above.corner, above.count);
  const auto of_both = both.count < 3 ? glm::dvec3(0.0) : edgeSum(both);
  const double one = 1.0 / (2.0 * std::numbers::pi);
  return {one * std::abs(glm::dot(of_above, geometric)), one * std::abs(glm::dot(of_both, shading))};
}

double polygonFormFactor(const glm::dvec3& point, const glm::dvec3& normal, std::span<const glm::vec3> corners) {
  return formFactorInFront(point, normal, corners).value;
}

}  // namespace radiosity::solver
