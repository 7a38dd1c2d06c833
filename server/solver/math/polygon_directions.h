// Directions in which a convex polygon is seen from a small receiver, drawn in proportion to the irradiance that comes
// by them: the part of them that meets nothing is, in the mean, the part of the polygon's form factor that is visible.
// Pure functions, any thread.
#pragma once

#include <array>
#include <cstddef>
#include <functional>
#include <glm/vec3.hpp>
#include <span>

namespace radiosity::solver {

class PolygonDirections {
 public:
  /// The polygon lies before the plane through `point` with the unit `normal`: 3 to 16 corners in a row. Of a polygon
  /// too small to be told from a point, the only direction is the one to its middle.
  PolygonDirections(const glm::dvec3& point, const glm::dvec3& normal, std::span<const glm::vec3> corners);

  /// A unit vector. `uniform` gives evenly spread numbers in [0, 1). A few hundred nanoseconds.
  /// Source: J. Arvo, "Stratified sampling of spherical triangles", SIGGRAPH 1995, and rejection by the cosine.
  [[nodiscard]] glm::dvec3 draw(const std::function<double()>& uniform) const;

 private:
  struct Triangle {
    glm::dvec3 a, b, c;  ///< unit vectors
    double solid_angle;  ///< steradians
    double angle_at_a, cosine_of_ab;
  };

  void addTriangle(const glm::dvec3& a, const glm::dvec3& b, const glm::dvec3& c);
  [[nodiscard]] double greatestCosine(std::span<const glm::dvec3> corners) const;

  glm::dvec3 normal_;
  glm::dvec3 middle_{0.0};
  std::array<Triangle, 14> triangles_;
  std::size_t count_ = 0;
  double solid_angle_ = 0.0;
  double most_ = 1.0;  ///< no direction has a greater cosine
};

}  // namespace radiosity::solver
