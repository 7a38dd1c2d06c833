#include "server/solver/math/polygon_directions.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/check.h"

namespace radiosity::solver {
namespace {

/// Steradians. The angles of a triangle are known to some 1e-14, and less than this is no part of any light.
constexpr double kPoint = 1e-11;

/// A direction is accepted with the ratio of its cosine to the greatest: more often than once in three for all but
/// needles that stand upright, for which their middle does.
constexpr int kTries = 64;

/// The unit vector of the part of `a` that is at right angles to the unit vector `to`.
glm::dvec3 across(const glm::dvec3& a, const glm::dvec3& to) {
  const auto part = a - glm::dot(a, to) * to;
  const double length = glm::length(part);
  return length > 0.0 ? part / length : part;
}

/// Between the planes through the great circles ab and ac.
double angleBetween(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const auto to_b = across(b, a), to_c = across(c, a);
  return std::atan2(glm::length(glm::cross(to_b, to_c)), glm::dot(to_b, to_c));
}

}  // namespace

PolygonDirections::PolygonDirections(const glm::dvec3& point, const glm::dvec3& normal,
                                     std::span<const glm::vec3> corners)
    : normal_(normal) {
  std::array<glm::dvec3, 16> ways;
  RAD_CHECK_LE(corners.size(), ways.size());
  std::size_t count = 0;
  for (const auto& corner : corners) {
    const auto way = glm::dvec3(corner) - point;
    const double length = glm::length(way);
    middle_ += way / static_cast<double>(corners.size());
    if (length > 0.0) ways[count++] = way / length;
  }
  const double length = glm::length(middle_);
  middle_ = length > 0.0 ? middle_ / length : normal;
  for (std::size_t i = 2; i < count; ++i) addTriangle(ways[0], ways[i - 1], ways[i]);
  most_ = greatestCosine(std::span(ways.data(), count));
}

void PolygonDirections::addTriangle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const double alpha = angleBetween(a, b, c);
  const double excess = alpha + angleBetween(b, c, a) + angleBetween(c, a, b) - std::numbers::pi;
  if (!(excess > kPoint)) return;
  triangles_[count_++] = {a, b, c, excess, alpha, glm::dot(a, b)};
  solid_angle_ += excess;
}

double PolygonDirections::greatestCosine(std::span<const glm::dvec3> corners) const {
  double most = 0.0;
  bool left = false, right = false;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto &a = corners[i], &b = corners[(i + 1) % corners.size()];
    most = std::max(most, glm::dot(normal_, a));
    const auto pole = glm::cross(a, b);
    const double side = glm::dot(normal_, pole);
    (side > 0.0 ? left : right) = true;
    // The great circle is highest where the normal's shadow falls on it, which may lie between the corners.
    const double square = glm::dot(pole, pole);
    const auto highest = square > 0.0 ? normal_ - (side / square) * pole : glm::dvec3(0.0);
    if (glm::dot(glm::cross(a, highest), pole) > 0.0 && glm::dot(glm::cross(highest, b), pole) > 0.0)
      most = std::max(most, glm::length(highest));
  }
  return left != right ? 1.0 : most;  // the normal itself is among the directions
}

glm::dvec3 PolygonDirections::draw(const std::function<double()>& uniform) const {
  for (int i = 0; i < kTries && count_ > 0; ++i) {
    double left = uniform() * solid_angle_;
    std::size_t k = 0;
    while (k + 1 < count_ && left >= triangles_[k].solid_angle) left -= triangles_[k++].solid_angle;
    const auto& of = triangles_[k];
    // The triangle a b d, with d between a and c, has the area `left`; the direction lies between b and d.
    const double s = std::sin(left - of.angle_at_a), t = std::cos(left - of.angle_at_a);
    const double sine = std::sin(of.angle_at_a), cosine = std::cos(of.angle_at_a);
    const double u = t - cosine, v = s + sine * of.cosine_of_ab;
    const double under = (v * s + u * t) * sine;
    const double q = under != 0.0 ? std::clamp(((v * t - u * s) * cosine - v) / under, -1.0, 1.0) : 1.0;
    const auto d = q * of.a + std::sqrt(1.0 - q * q) * across(of.c, of.a);
    const double z = 1.0 - uniform() * (1.0 - glm::dot(d, of.b));
    const auto direction = z * of.b + std::sqrt(std::max(0.0, 1.0 - z * z)) * across(d, of.b);
    if (uniform() * most_ < glm::dot(direction, normal_)) return direction;
  }
  return middle_;
}

}  // namespace radiosity::solver
