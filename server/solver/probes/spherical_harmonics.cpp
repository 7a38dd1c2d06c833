#include "server/solver/probes/spherical_harmonics.h"

#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

namespace radiosity::solver {
namespace {

/// Corners that the polygons of a lamp have at most.
constexpr std::size_t kMostCorners = 8;
/// An edge that is seen under less than this (rad) adds nothing to the moments.
constexpr double kLeastEdge = 1e-12;

/// Of a spherical triangle, with the sign of its winding.
double solidAngle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c) {
  const double volume = glm::dot(a, glm::cross(b, c));
  return 2.0 * std::atan2(volume, 1.0 + glm::dot(a, b) + glm::dot(b, c) + glm::dot(c, a));
}

/// Moments of the directions w in which something is seen: the integrals of 1, w and w w^T.
struct Moments {
  double solid_angle = 0.0;
  glm::dvec3 first{0.0};
  glm::dmat3 second{0.0};
};

Moments momentsOf(std::span<const glm::dvec3> ways) {
  Moments moments;
  for (std::size_t i = 1; i + 1 < ways.size(); ++i) moments.solid_angle += solidAngle(ways[0], ways[i], ways[i + 1]);
  glm::dmat3 edges(0.0);
  for (std::size_t i = 0; i < ways.size(); ++i) {
    const auto &a = ways[i], &b = ways[(i + 1) % ways.size()];
    const auto across = glm::cross(a, b);
    const double sine = glm::length(across), angle = std::atan2(sine, glm::dot(a, b));
    if (sine < kLeastEdge) continue;
    const auto normal = across / sine, along = std::tan(0.5 * angle) * (a + b);  // integral of w over the edge
    moments.first += 0.5 * angle * normal;
    edges += glm::outerProduct(normal, along) + glm::outerProduct(along, normal);
  }
  moments.second = (glm::dmat3(moments.solid_angle) + 0.5 * edges) / 3.0;
  return moments;
}

}  // namespace

std::array<double, kHarmonics> polygonHarmonics(const glm::dvec3& place, std::span<const glm::vec3> corners) {
  std::array<glm::dvec3, kMostCorners> ways;
  for (std::size_t i = 0; i < corners.size(); ++i) ways[i] = glm::normalize(glm::dvec3(corners[i]) - place);
  const auto moments = momentsOf(std::span(ways).first(corners.size()));
  const double sign = moments.solid_angle < 0.0 ? -1.0 : 1.0;
  const double all = sign * moments.solid_angle;
  const auto first = sign * moments.first;
  const auto second = sign * moments.second;
  constexpr double k0 = 0.28209479177387814, k1 = 0.4886025119029199, k2 = 1.0925484305920792;
  constexpr double k20 = 0.31539156525252005, k22 = 0.5462742152960396;
  return {k0 * all,
          k1 * first.y,
          k1 * first.z,
          k1 * first.x,
          k2 * second[0][1],
          k2 * second[1][2],
          k20 * (3.0 * second[2][2] - all),
          k2 * second[0][2],
          k22 * (second[0][0] - second[1][1])};
}

}  // namespace radiosity::solver
