#include "server/solver/change_reach.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

namespace radiosity::solver {
namespace {

/// A quad that one plane has cut has at most five corners.
struct Cut {
  std::array<glm::vec3, 5> corner{};
  std::size_t count = 0;
};

/// What of a quad about the origin lies above the plane through it.
Cut cutAtHorizon(const std::array<glm::vec3, 4>& quad, const glm::vec3& normal) {
  Cut cut;
  for (std::size_t k = 0; k < 4; ++k) {
    const auto &a = quad[k], &b = quad[(k + 1) % 4];
    const float above_a = glm::dot(normal, a), above_b = glm::dot(normal, b);
    if (above_a >= 0.0F) cut.corner[cut.count++] = a;
    if ((above_a > 0.0F && above_b < 0.0F) || (above_a < 0.0F && above_b > 0.0F))
      cut.corner[cut.count++] = a + above_a / (above_a - above_b) * (b - a);
  }
  return cut;
}

double lambert(const Cut& polygon, const glm::vec3& normal) {
  double sum = 0.0;
  for (std::size_t k = 0; k < polygon.count; ++k) {
    const auto &a = polygon.corner[k], &b = polygon.corner[(k + 1) % polygon.count];
    const auto across = glm::cross(a, b);
    const float length = glm::length(across);
    if (!(length > 0.0F)) continue;
    sum += static_cast<double>(std::atan2(length, glm::dot(a, b)) * glm::dot(across, normal) / length);
  }
  return 0.5 * std::numbers::inv_pi * std::abs(sum);
}

}  // namespace

double throughBox(const glm::vec3& origin, const glm::vec3& normal, const scene::ChangedBox& box) {
  bool inside = true;
  double sum = 0.0;
  for (int axis = 0; axis < 3; ++axis) {
    const bool before = origin[axis] < box.low[axis];
    if (!before && origin[axis] <= box.high[axis]) continue;
    inside = false;
    const int u = (axis + 1) % 3, v = (axis + 2) % 3;
    std::array<glm::vec3, 4> face{};
    for (std::size_t k = 0; k < 4; ++k) {
      face[k][axis] = before ? box.low[axis] : box.high[axis];
      face[k][u] = k == 1 || k == 2 ? box.high[u] : box.low[u];
      face[k][v] = k >= 2 ? box.high[v] : box.low[v];
      face[k] -= origin;
    }
    sum += lambert(cutAtHorizon(face, normal), normal);
  }
  return inside ? 1.0 : std::min(1.0, sum);
}

double changeReach(const glm::vec3& origin, const glm::vec3& normal, const scene::ChangedBox& shooter, double area,
                   std::span<const scene::ChangedBox> boxes) {
  double squares = 0.0;
  for (const auto& box : boxes) {
    const auto gap = glm::max(glm::max(box.low - shooter.high, shooter.low - box.high), glm::vec3(0.0F));
    const auto apart = static_cast<double>(glm::dot(gap, gap));
    const double largest = area < std::numbers::pi * apart ? area / (std::numbers::pi * apart) : 1.0;
    squares += 2.0 * largest * area * throughBox(origin, normal, box);
  }
  return std::sqrt(squares);
}

}  // namespace radiosity::solver
