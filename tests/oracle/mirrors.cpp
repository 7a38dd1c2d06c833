#include "tests/oracle/mirrors.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "tests/oracle/directions.h"

namespace radiosity::oracle {
namespace {

/// Slopes narrower than this are those of a perfect mirror.
constexpr double kLeastWidth = 1e-4;

struct Drawn {
  glm::dvec3 direction;
  double weight, cosine;  ///< of a white mirror; between the ray and the microfacet
};

Drawn draw(const glm::dvec3& normal, const glm::dvec3& direction, double width, Random& random) {
  const double u = random.uniform(), angle = 2.0 * std::numbers::pi * random.uniform();
  const double tangent = width * std::sqrt(u / (1.0 - u)), up = 1.0 / std::sqrt(1.0 + tangent * tangent);
  const auto [s, t] = tangents(normal);
  const auto facet = up * (tangent * (std::cos(angle) * s + std::sin(angle) * t) + normal);
  const double cosine = -glm::dot(direction, facet), out = -glm::dot(direction, normal);
  const auto way = direction + 2.0 * cosine * facet;
  const double in = glm::dot(way, normal);
  if (cosine <= 0.0 || in <= 0.0) return {normal, 0.0, 1.0};
  const auto smith = [&](double z) {
    const double across = (1.0 - z * z) / (z * z);
    return 0.5 * (std::sqrt(1.0 + width * width * across) - 1.0);
  };
  return {way, cosine / (out * up * (1.0 + smith(out) + smith(in))), cosine};
}

}  // namespace

RoughMirror::RoughMirror(double roughness) : width_(roughness * roughness) {
  constexpr std::size_t kCosines = 65;
  constexpr int kDraws = 16384;
  if (width_ < kLeastWidth) return;
  const glm::dvec3 normal(0.0, 0.0, 1.0);
  double weight = 0.0;
  for (std::size_t i = 0; i < kCosines; ++i) {
    const double out = std::max(0.004, static_cast<double>(i) / (kCosines - 1.0));
    Random random(17 + i);
    double sum = 0.0;
    for (int k = 0; k < kDraws; ++k)
      sum += draw(normal, {std::sqrt(1.0 - out * out), 0.0, -out}, width_, random).weight;
    kept_.push_back(std::clamp(sum / kDraws, 0.05, 1.0));
    mean_ += out * kept_.back();
    weight += out;
  }
  mean_ /= weight;
}

double RoughMirror::kept(double cosine) const {
  const double place = std::clamp(cosine, 0.0, 1.0) * (static_cast<double>(kept_.size()) - 1.0);
  const auto below = std::min(static_cast<std::size_t>(place), kept_.size() - 2);
  const double part = place - static_cast<double>(below);
  return (1.0 - part) * kept_[below] + part * kept_[below + 1];
}

glm::dvec3 reflect(const glm::dvec3& normal, const glm::dvec3& direction, const Shading::Facing& facing,
                   const RoughMirror& mirror, glm::dvec3& part, Random& random) {
  const double out = -glm::dot(direction, normal);
  if (mirror.width() < kLeastWidth) {
    part *= facing.at(out);
    return direction + 2.0 * out * normal;
  }
  const auto drawn = draw(normal, direction, mirror.width(), random);
  const double kept = mirror.kept(out);
  const auto once = facing.straight + (facing.along - facing.straight) / 21.0;
  const auto again = once * mirror.mean() / (glm::dvec3(1.0) - once * (1.0 - mirror.mean()));
  part *= drawn.weight * facing.at(drawn.cosine) * (1.0 + again * (1.0 - kept) / kept);
  return drawn.direction;
}

std::optional<glm::dvec3> Mirrors::goOn(const Shading& shading, const Triangle& triangle, const Place& place,
                                        const glm::dvec3& direction, glm::dvec3& part, Random& random) const {
  const auto [u, v] = Shading::weights(triangle, place.position);
  const auto facing = shading.mirror(triangle, u, v);
  if (!facing.any() && triangle.transmission <= 0.0) return std::nullopt;
  const double passing = shading.passing(triangle, u, v), cosine = -glm::dot(direction, place.normal);
  // The back of one side passes light; it reflects where that is all the front does.
  const double lit = place.is_back && !hasTwoSides(triangle) && passing < 0.999 ? 0.0 : 1.0;
  const auto usual = facing.at(cosine);
  const double chance = std::clamp(std::max({usual.x, usual.y, usual.z}), 0.05, 0.95);
  if (random.uniform() < chance) {
    part *= lit / chance;
    return reflect(place.normal, direction, facing, rough_.at(triangle.mirror.roughness), part, random);
  }
  part /= 1.0 - chance;
  if (triangle.transmission <= 0.0) return std::nullopt;
  const double enters = 1.0 - Shading::interfaceReflectance(triangle, cosine);
  if (random.uniform() >= passing) {
    part *= enters * lit / (1.0 - passing);  // the reflectance is of all that enters
    return std::nullopt;
  }
  part *= shading.tint(triangle, u, v) * enters;
  return direction;
}

}  // namespace radiosity::oracle
