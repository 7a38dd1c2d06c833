#include "server/gpu/gather/form_factor_kernel.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <type_traits>

#include "common/clones.h"

namespace radiosity::gpu {
namespace {

/// acos(x) = sqrt(1 - x) P(x) on [0, 1], error 2e-8 (Abramowitz and Stegun 4.4.46).
inline float acosPolynomial(float x) {
  float p = -0.0012624911F;
  p = p * x + 0.0066700901F;
  p = p * x - 0.0170881256F;
  p = p * x + 0.0308918810F;
  p = p * x - 0.0501743046F;
  p = p * x + 0.0889789874F;
  p = p * x - 0.2145988016F;
  return p * x + 1.5707963050F;
}

/// theta / sin(theta) for cos(theta) = x; no cancellation at small angles, where sqrt(1 - x) divides out.
inline float angleOverSine(float x) {
  const float t = std::abs(x);
  const float small = acosPolynomial(t) / std::sqrt(1.0F + t);
  const float large = std::numbers::pi_v<float> / std::sqrt(std::max(1.0F - t * t, 1e-12F)) - small;
  return x >= 0.0F ? small : large;
}

/// Corners, and the edges from each to the next, of a polygon, as planes of floats.
struct Edges {
  float x[9] = {}, y[9] = {}, z[9] = {}, ex[9] = {}, ey[9] = {}, ez[9] = {};

  explicit Edges(std::span<const glm::vec3> corners) {
    for (std::size_t k = 0; k < corners.size(); ++k) {
      const auto edge = corners[(k + 1) % corners.size()] - corners[k];
      x[k] = corners[k].x;
      y[k] = corners[k].y;
      z[k] = corners[k].z;
      ex[k] = edge.x;
      ey[k] = edge.y;
      ez[k] = edge.z;
    }
  }
};

/// The normal of an edge's triangle with the receiver is v_k x v_m = v_k x e_k: from the edge itself, because the small
/// difference of two directions would leave nothing of a polygon that is a ten-thousandth of its distance across.
template <std::size_t kCorners>
[[gnu::always_inline]] inline float lambertSum(const Edges& edges, float nx, float ny, float nz, float x, float y,
                                               float z) {
  float vx[kCorners], vy[kCorners], vz[kCorners], inverse[kCorners];
#pragma GCC unroll 9
  for (std::size_t k = 0; k < kCorners; ++k) {
    vx[k] = edges.x[k] - x;
    vy[k] = edges.y[k] - y;
    vz[k] = edges.z[k] - z;
    inverse[k] = 1.0F / std::sqrt(std::max(vx[k] * vx[k] + vy[k] * vy[k] + vz[k] * vz[k], 1e-20F));
  }
  float sum = 0.0F;
#pragma GCC unroll 9
  for (std::size_t k = 0; k < kCorners; ++k) {
    const std::size_t m = (k + 1) % kCorners;
    const float lengths = inverse[k] * inverse[m];
    const float dot = vx[k] * vx[m] + vy[k] * vy[m] + vz[k] * vz[m];
    const float along = (vy[k] * edges.ez[k] - vz[k] * edges.ey[k]) * nx +
                        (vz[k] * edges.ex[k] - vx[k] * edges.ez[k]) * ny +
                        (vx[k] * edges.ey[k] - vy[k] * edges.ex[k]) * nz;
    sum += angleOverSine(dot * lengths) * (along * lengths);
  }
  return std::min(std::abs(sum) * (0.5F * std::numbers::inv_pi_v<float>), 1.0F);
}

}  // namespace

ClippedPolygon clipToPlane(std::span<const glm::vec3> corners, const glm::vec3& point, const glm::vec3& normal) {
  ClippedPolygon clipped;
  const std::size_t count = corners.size();
  for (std::size_t i = 0; i < count; ++i) {
    const glm::dvec3 a(corners[i]), b(corners[(i + 1) % count]);
    const double height_a = glm::dot(a - glm::dvec3(point), glm::dvec3(normal));
    const double height_b = glm::dot(b - glm::dvec3(point), glm::dvec3(normal));
    if (height_a >= 0.0) clipped.corner[clipped.count++] = corners[i];
    if ((height_a < 0.0) != (height_b < 0.0) && height_a != 0.0 && height_b != 0.0) {
      clipped.corner[clipped.count++] = glm::vec3(a + (b - a) * (height_a / (height_a - height_b)));
    }
  }
  if (clipped.count < 3) clipped.count = 0;
  clipped.count = std::min(clipped.count, std::size_t{9});
  return clipped;
}

namespace {

/// The number of corners is a constant in each loop, so that the loop over receivers vectorises.
template <typename Loop>
[[gnu::always_inline]] inline void withCorners(std::size_t count, const Loop& loop) {
  switch (count) {
    case 3:
      return loop(std::integral_constant<std::size_t, 3>());
    case 4:
      return loop(std::integral_constant<std::size_t, 4>());
    case 5:
      return loop(std::integral_constant<std::size_t, 5>());
    case 6:
      return loop(std::integral_constant<std::size_t, 6>());
    case 7:
      return loop(std::integral_constant<std::size_t, 7>());
    case 8:
      return loop(std::integral_constant<std::size_t, 8>());
    default:
      return loop(std::integral_constant<std::size_t, 9>());
  }
}

}  // namespace

// One clone for processors with 256-bit vectors. No fused multiply-add in either, so both give the same bits.
RADIOSITY_CLONES void planarFormFactors(const ClippedPolygon& polygon, const glm::vec3& normal, const float* x,
                                        const float* y, const float* z, std::size_t count, float* form_factor) {
  const Edges edges(std::span(polygon.corner.data(), polygon.count));
  const float nx = normal.x, ny = normal.y, nz = normal.z;
  withCorners(
      polygon.count, [&]<std::size_t kCorners>(std::integral_constant<std::size_t, kCorners>)
                         __attribute__((always_inline)) {
                           for (std::size_t i = 0; i < count; ++i)
                             form_factor[i] = lambertSum<kCorners>(edges, nx, ny, nz, x[i], y[i], z[i]);
                         });
}

RADIOSITY_CLONES void wholeFormFactors(std::span<const glm::vec3> corners, const FormFactorPoints& points,
                                       std::size_t count, float* form_factor) {
  const Edges edges(corners);
  const auto [x, y, z, nx, ny, nz] = points;
  withCorners(
      corners.size(), [&, x = x, y = y, z = z, nx = nx, ny = ny, nz = nz ]<std::size_t kCorners>(
                          std::integral_constant<std::size_t, kCorners>) __attribute__((always_inline)) {
        for (std::size_t i = 0; i < count; ++i)
          form_factor[i] = lambertSum<kCorners>(edges, nx[i], ny[i], nz[i], x[i], y[i], z[i]);
      });
}

}  // namespace radiosity::gpu
