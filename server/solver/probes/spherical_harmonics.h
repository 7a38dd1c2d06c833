// Real spherical harmonics up to band 2, and what polygons are in them. Pure functions; any thread.
#pragma once

#include <array>
#include <cstddef>
#include <glm/vec3.hpp>
#include <span>

namespace radiosity::solver {

/// Coefficients of bands 0, 1 and 2.
inline constexpr std::size_t kHarmonics = 9;

/// Orthonormal over the sphere, in the order (band, order) 00, 1-1, 10, 11, 2-2, 2-1, 20, 21, 22, without the sign of
/// Condon and Shortley: 0.282095, 0.488603 {y, z, x}, 1.092548 {xy, yz}, 0.315392 (3 z^2 - 1), 1.092548 xz,
/// 0.546274 (x^2 - y^2) (Ramamoorthi and Hanrahan 2001, "An efficient representation for irradiance environment maps").
/// `direction`: unit length.
template <typename Real>
[[nodiscard]] std::array<Real, kHarmonics> harmonicsOf(Real x, Real y, Real z) {
  constexpr auto k0 = static_cast<Real>(0.28209479177387814), k1 = static_cast<Real>(0.4886025119029199);
  constexpr auto k2 = static_cast<Real>(1.0925484305920792), k20 = static_cast<Real>(0.31539156525252005);
  constexpr auto k22 = static_cast<Real>(0.5462742152960396);
  return {k0,
          k1 * y,
          k1 * z,
          k1 * x,
          k2 * x * y,
          k2 * y * z,
          k20 * (Real(3) * z * z - Real(1)),
          k2 * x * z,
          k22 * (x * x - y * y)};
}
[[nodiscard]] inline std::array<double, kHarmonics> harmonicsOf(const glm::dvec3& direction) {
  return harmonicsOf<double>(direction.x, direction.y, direction.z);
}

/// Integrals of the harmonics over the directions in which a convex polygon is seen from a place that is not in its
/// plane, exactly: solid angle (Van Oosterom and Strackee 1983), vector irradiance (Lambert), and the second moments by
/// the divergence theorem, as Arvo 1995, "Applications of irradiance tensors", has them. Either winding.
[[nodiscard]] std::array<double, kHarmonics> polygonHarmonics(const glm::dvec3& place,
                                                              std::span<const glm::vec3> corners);

}  // namespace radiosity::solver
