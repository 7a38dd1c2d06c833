// Form factors of lamps that are round: a disc and a ball, cut by the receiver's horizon. Closed forms; pure functions,
// any thread.
#pragma once

#include <glm/vec3.hpp>

namespace radiosity::solver {

/// Irradiance at `point` (unit `normal`) from a disc of radiosity 1 that shines along `axis` (unit length), with
/// nothing in between: Lambert's contour integral along the part of the rim above the horizon, and along the chord. 0
/// behind the disc and in its plane.
[[nodiscard]] double discFormFactor(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& centre,
                                    const glm::dvec3& axis, double radius);

/// The same of a ball: (radius / distance)^2 cos where the horizon does not cut it (Lagarde and de Rousiers, "Moving
/// Frostbite to Physically Based Rendering", 2014, for where it does). Points within the ball are taken to lie on it.
[[nodiscard]] double ballFormFactor(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& centre,
                                    double radius);

}  // namespace radiosity::solver
