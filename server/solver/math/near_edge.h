// Receivers whose plane cuts off part of a shooter, where what it leaves is near to them. They look at places of that
// part instead of the shooter's own points (server/gpu/gather/light_gatherer_edge.cpp), which edits have to know.
#pragma once

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <span>

#include "server/solver/math/polygon_form_factor.h"

namespace radiosity::solver {

/// Near: the form factor of the part is more than this times the part's share of the shooter. Below it a single point
/// of the shooter, seen by chance, adds no more than this times its radiosity.
inline constexpr float kNearEdge = 0.1F;

/// Where such receivers are, and what they look at. From a distance of d on, the form factor of a share s of an area A
/// is at most s A / (pi d^2).
struct EdgeBall {
  glm::vec3 middle{0.0F};
  float radius = 0.0F;  ///< around the shooter
  float reach = 0.0F;   ///< around the receivers and the shooter

  explicit EdgeBall(std::span<const glm::vec3> corners) {
    for (const auto& corner : corners) middle += corner / static_cast<float>(corners.size());
    for (const auto& corner : corners) radius = std::max(radius, glm::distance(middle, corner));
    const double near = std::numbers::pi * static_cast<double>(kNearEdge);
    reach = radius + static_cast<float>(std::sqrt(polygonArea(corners) / near));
  }
};

}  // namespace radiosity::solver
