#include "server/solver/math/microfacets.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Slopes narrower than this are those of a perfect mirror.
constexpr double kLeastWidth = 1e-4;
/// Directions this near the normal, or the horizon, are taken for it: Smith's functions have no limit there in numbers.
constexpr double kAlong = 0.9999, kAcross = 1e-4;
/// Directions leave at least so far above the surface.
constexpr double kLeastHeight = 1e-4;

double edgeOf(double cosine) { return std::pow(std::clamp(1.0 - cosine, 0.0, 1.0), 5.0); }

/// Random numbers, one after the other.
class Draws {
 public:
  explicit Draws(std::uint64_t key) : key_(key) {}
  double next() { return uniformFromKey(mixKeys(key_, ++count_)); }

 private:
  std::uint64_t key_, count_ = 0;
};

/// Smith's Lambda for slopes of this width.
double lambda(double z, double width) {
  const double tangent = std::sqrt(std::max(0.0, 1.0 - z * z)) / z, a = 1.0 / (tangent * width);
  return 0.5 * (-1.0 + std::copysign(std::sqrt(1.0 + 1.0 / (a * a)), a));
}

/// How high a ray gets before it meets a microfacet, of heights evenly spread over [-1, 1]; above 1: it leaves.
double nextHeight(double z, double height, double width, double chance) {
  constexpr double kLeaves = 2.0;
  if (z > kAlong) return kLeaves;
  const double below = std::clamp(0.5 * (height + 1.0), 0.0, 1.0);
  if (z < -kAlong) return 2.0 * chance * below - 1.0;
  if (std::abs(z) < kAcross) return height;
  const double of_slopes = lambda(z, width);
  if (z > 0.0 && chance > 1.0 - std::pow(below, of_slopes)) return kLeaves;
  return std::clamp(2.0 * below / std::pow(1.0 - chance, 1.0 / of_slopes) - 1.0, -1.0, 1.0);
}

/// A microfacet's normal as a viewer along `to` sees them, who may look from below (Dupuy and Benyoub 2023, "Sampling
/// visible GGX normals with spherical caps").
glm::dvec3 visibleNormal(const glm::dvec3& to, double width, double u, double v) {
  const auto stretched = glm::normalize(glm::dvec3(width * to.x, width * to.y, to.z));
  const double angle = 2.0 * std::numbers::pi * u, z = (1.0 - v) * (1.0 + stretched.z) - stretched.z;
  const double radius = std::sqrt(std::clamp(1.0 - z * z, 0.0, 1.0));
  const auto half = glm::dvec3(radius * std::cos(angle), radius * std::sin(angle), z) + stretched;
  return glm::normalize(glm::dvec3(width * half.x, width * half.y, std::max(half.z, 1e-9)));
}

/// In the frame of the surface, z along its normal.
Reflection walk(glm::dvec3 way, double width, Draws draws) {
  Reflection reflection;
  double height = 1.0;
  while (reflection.count < Reflection::kMostBounces) {
    height = reflection.count == 0 ? std::min(nextHeight(way.z, height, width, draws.next()), 1.0)
                                   : nextHeight(way.z, height, width, draws.next());
    if (height > 1.0) break;
    const double u = draws.next(), v = draws.next();
    const auto facet = visibleNormal(-way, width, u, v);
    const double cosine = -glm::dot(way, facet);
    reflection.edge[reflection.count++] = edgeOf(cosine);
    way += 2.0 * cosine * facet;
  }
  way.z = std::max(std::abs(way.z), kLeastHeight);
  reflection.direction = glm::normalize(way);
  return reflection;
}

}  // namespace

Reflection reflectByMicrofacets(const glm::dvec3& normal, const glm::dvec3& direction, double roughness,
                                std::uint64_t key) {
  const double width = roughness * roughness, cosine = -glm::dot(normal, direction);
  if (width < kLeastWidth) {
    Reflection mirrored;
    mirrored.direction = direction + 2.0 * cosine * normal;
    mirrored.edge[mirrored.count++] = edgeOf(cosine);
    return mirrored;
  }
  const glm::dvec3 helper = std::abs(normal.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  const glm::dvec3 a = glm::normalize(glm::cross(helper, normal)), b = glm::cross(normal, a);
  auto reflection = walk({glm::dot(direction, a), glm::dot(direction, b), -cosine}, width, Draws(key));
  const auto& way = reflection.direction;
  reflection.direction = way.x * a + way.y * b + way.z * normal;
  return reflection;
}

/// Heights of microfacets are evenly spread, so that what one hides from one side and the other go together: Smith's
/// masking and shadowing is that of Heitz (2014, "Understanding the Masking-Shadowing Function"), correlated by height.
OneBounce bounceOnce(const glm::dvec3& normal, const glm::dvec3& direction, const glm::dvec3& out, double roughness) {
  const double width = roughness * roughness, in_z = -glm::dot(normal, direction), out_z = glm::dot(normal, out);
  if (width < kLeastWidth || in_z <= 0.0 || out_z <= 0.0) return {};
  const auto facet = glm::normalize(out - direction);
  const double z = glm::dot(normal, facet), spread = z * z * (width * width - 1.0) + 1.0;
  const double facets = width * width / (std::numbers::pi * spread * spread);
  const auto hidden = [&](double cosine) { return cosine > kAlong ? 0.0 : lambda(cosine, width); };
  return {facets / ((1.0 + hidden(in_z) + hidden(out_z)) * 4.0 * in_z), edgeOf(glm::dot(facet, out))};
}

}  // namespace radiosity::solver
