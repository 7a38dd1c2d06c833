// Lambert's formula: the exact form factor from a small receiver to a convex polygon, clipped to the receiver's
// horizon. Pure functions, any thread.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <span>

namespace radiosity::solver {

/// What of a convex polygon lies above a receiver's plane: `count` corners in a row, less than 3 where nothing does.
struct CornersAbove {
  std::array<glm::vec3, 9> corner;
  std::size_t count = 0;
};
/// At most 8 corners.
[[nodiscard]] CornersAbove cornersAbove(const glm::dvec3& point, const glm::dvec3& normal,
                                        std::span<const glm::vec3> corners);

struct FormFactor {
  double value = 0.0;
  double front = 0.0;  ///< part of the polygon's area above the receiver's plane
};

/// Irradiance at `point` (unit `normal`) from a polygon of radiosity 1 with nothing in between: 1/(2 pi) |sum of
/// theta_k (gamma_k . n)| over the edges of the polygon's part above the receiver's plane (Lambert 1760; Baum,
/// Rushmeier and Winget 1989). At most 8 corners. The polygon must face the point; 0 when it is below the horizon.
[[nodiscard]] FormFactor formFactorInFront(const glm::dvec3& point, const glm::dvec3& normal,
                                           std::span<const glm::vec3> corners);
/// Of the part of the polygon above the plane of `geometric`: its form factor, and what of it is above that of
/// `shading` too, weighed by the cosine with that one.
struct FormFactorsAboveBoth {
  double geometric = 0.0, shading = 0.0;
};
[[nodiscard]] FormFactorsAboveBoth formFactorsAboveBoth(const glm::dvec3& point, const glm::dvec3& geometric,
                                                        const glm::dvec3& shading, std::span<const glm::vec3> corners);
[[nodiscard]] double polygonFormFactor(const glm::dvec3& point, const glm::dvec3& normal,
                                       std::span<const glm::vec3> corners);

[[nodiscard]] double polygonArea(std::span<const glm::vec3> corners);

}  // namespace radiosity::solver
