// Point-to-polygon form factors of many receivers in one plane, in single precision and vectorised.
// server/solver/math/polygon_form_factor.h is the plain version, which the tests hold this one against.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <span>

namespace radiosity::gpu {

/// A convex polygon of at most eight corners clipped by the receivers' plane.
struct ClippedPolygon {
  std::array<glm::vec3, 16> corner{};  // rounding may make the signs of heights alternate
  std::size_t count = 0;               ///< 0 or 3..9
};

/// The part of the polygon in front of the plane through `point` with `normal`. In double inside.
[[nodiscard]] ClippedPolygon clipToPlane(std::span<const glm::vec3> corners, const glm::vec3& point,
                                         const glm::vec3& normal);

/// How much of the part of a polygon in front of a receiver shines where of the whole polygon `fill` does: not more
/// than all. `front`: that part, of the polygon's area.
[[nodiscard]] inline double shining(double fill, double front) {
  return front > 0.0 ? std::min(1.0, fill / front) : 1.0;
}

/// Receivers at (x, y, z)[i], all with the same normal, in the plane that `polygon` was clipped to. form_factor[i] in
/// [0, 1]; about 1e-7 absolute.
void planarFormFactors(const ClippedPolygon& polygon, const glm::vec3& normal, const float* x, const float* y,
                       const float* z, std::size_t count, float* form_factor);

/// Points with normals, as arrays of equal length.
struct FormFactorPoints {
  const float *x, *y, *z, *nx, *ny, *nz;
};

/// The same for points of any normals, in front of whose planes all of the polygon lies (3 to 9 corners).
void wholeFormFactors(std::span<const glm::vec3> corners, const FormFactorPoints& points, std::size_t count,
                      float* form_factor);

}  // namespace radiosity::gpu
