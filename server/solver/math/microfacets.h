// Where light goes that a rough mirror reflects: a walk between microfacets that face as GGX says (Heitz, Hanika, d'Eon
// and Dachsbacher 2016, "Multiple-scattering microfacet BSDFs with the Smith model"), so that no light is lost however
// rough the surface is: what one bounce leaves within the surface bounces again. Pure.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>

namespace radiosity::solver {

/// A ray after it was reflected.
struct Reflection {
  /// Bounces between microfacets; whatever is left after these leaves.
  static constexpr std::size_t kMostBounces = 8;

  glm::dvec3 direction{0.0};  ///< above the surface
  std::size_t count = 0;      ///< of bounces, one at least
  /// Schlick's (1 - cos)^5 of each: it reflects facing + (grazing - facing) times this. The product of all is what the
  /// surface reflects, without any other weight: directions are drawn as light leaves.
  std::array<double, kMostBounces> edge{};

  [[nodiscard]] std::span<const double> edges() const { return std::span(edge).first(count); }
};

/// `normal`: of the side that the ray meets, which travels along `direction`. `roughness`: as of glTF, 0 to 1; 0 is a
/// perfect mirror. By chance from `key`. Reciprocal: a ray from the other end is as likely to go the same way.
[[nodiscard]] Reflection reflectByMicrofacets(const glm::dvec3& normal, const glm::dvec3& direction, double roughness,
                                              std::uint64_t key);

/// Of all light that such a surface reflects, the part by solid angle that leaves along `out` after one bounce, if
/// nothing is absorbed; and Schlick's (1 - cos)^5 of that. Of a perfect mirror: none.
struct OneBounce {
  double density = 0.0, edge = 0.0;
};
[[nodiscard]] OneBounce bounceOnce(const glm::dvec3& normal, const glm::dvec3& direction, const glm::dvec3& out,
                                   double roughness);

}  // namespace radiosity::solver
