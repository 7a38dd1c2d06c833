// Form factors in closed form or by adaptive integration to a stated tolerance: the values the fast path is judged by.
// Double precision, no GL, nothing of the server. Pure functions.
//
// F(from, to) is the fraction of the diffuse light leaving `from` that arrives at `to`. Polygons are convex, planar and
// counter-clockwise seen from the front; light leaves and arrives at fronts only.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

namespace radiosity::oracle {

using Corners = std::vector<glm::dvec3>;

/// Two equal rectangles width x depth, opposite each other (Howell, A Catalog of Radiation Configuration Factors,
/// C-11).
[[nodiscard]] double parallelRectangles(double width, double depth, double distance);

/// Two rectangles at 90 degrees with a common edge, from edge x from_depth to edge x to_depth (Howell C-14).
[[nodiscard]] double perpendicularRectangles(double edge, double from_depth, double to_depth);

/// From a disc to a coaxial parallel disc (Howell C-41).
[[nodiscard]] double coaxialDiscs(double from_radius, double to_radius, double distance);

/// From an infinitesimal area to a polygon: Lambert's formula, the polygon clipped at the receiver's horizon.
/// Irradiance at the point = radiosity of the polygon x this. 0 behind the polygon.
[[nodiscard]] double pointToPolygon(const glm::dvec3& point, const glm::dvec3& normal,
                                    std::span<const glm::dvec3> polygon);

/// The same for what can be seen of the polygon past `occluders` (convex polygons; both of their sides block). Exact:
/// the shadow pyramids are cut out of the polygon. An occluder in whose plane the point lies blocks nothing.
[[nodiscard]] double pointToPolygon(const glm::dvec3& point, const glm::dvec3& normal,
                                    std::span<const glm::dvec3> polygon, std::span<const Corners> occluders);

struct IntegrationOptions {
  double tolerance = 1e-7;  ///< absolute error of F, about; 0: a fixed rule of 7 points a triangle, no subdivision
  int max_depth = 9;        ///< of the subdivision of `from`
};

/// Mean of pointToPolygon over `from`.
[[nodiscard]] double formFactor(const Corners& from, const Corners& to, std::span<const Corners> occluders = {},
                                const IntegrationOptions& options = {});

[[nodiscard]] glm::dvec3 unitNormal(std::span<const glm::dvec3> polygon);
[[nodiscard]] double area(std::span<const glm::dvec3> polygon);

}  // namespace radiosity::oracle
