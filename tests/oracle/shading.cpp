#include "tests/oracle/shading.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec4.hpp>

namespace radiosity::oracle {
namespace {

template <typename T>
T between(const std::array<T, 3>& corners, double u, double v) {
  return corners[0] * (1.0 - u - v) + corners[1] * u + corners[2] * v;
}

}  // namespace

std::pair<double, double> Shading::weights(const Triangle& triangle, const glm::dvec3& position) {
  const auto& [a, b, c] = triangle.corners;
  const auto normal = glm::cross(b - a, c - a);
  const double square = glm::dot(normal, normal);
  return {glm::dot(glm::cross(position - a, c - a), normal) / square,
          glm::dot(glm::cross(b - a, position - a), normal) / square};
}

glm::dvec4 Shading::colour(const TextureUse& use, double u, double v) const {
  const auto* texture = textureOf(use);
  return texture == nullptr ? glm::dvec4(1.0) : texture->colour(between(use.uv, u, v));
}

glm::dvec4 Shading::value(const TextureUse& use, double u, double v) const {
  const auto* texture = textureOf(use);
  return texture == nullptr ? glm::dvec4(1.0) : texture->value(between(use.uv, u, v));
}

glm::dvec3 Shading::reflectance(const Triangle& triangle, double u, double v) const {
  const double part = transmittedPart(triangle, u, v);
  return part > 0.0 ? baseReflectance(triangle, u, v) * (1.0 - part) : baseReflectance(triangle, u, v);
}

glm::dvec3 Shading::baseReflectance(const Triangle& triangle, double u, double v) const {
  auto result = triangle.reflectance * glm::dvec3(colour(triangle.base_colour, u, v));
  if (triangle.coloured) result *= glm::dvec3(between(triangle.colours, u, v));
  result *= diffusePart(triangle, u, v);
  return glm::clamp(result, glm::dvec3(0.0), glm::dvec3(kMostReflectance));
}

glm::dvec3 Shading::transmittance(const Triangle& triangle, double u, double v) const {
  if (!(triangle.diffuse_transmission > 0.0)) return glm::dvec3(0.0);
  const auto result = triangle.transmitted * glm::dvec3(colour(triangle.transmission_colour, u, v)) *
                      (diffusePart(triangle, u, v) * transmittedPart(triangle, u, v));
  return glm::clamp(result, glm::dvec3(0.0), glm::dvec3(kMostReflectance));
}

Shading::Scattered Shading::scatter(const Triangle& triangle, double u, double v, double chance) const {
  const auto reflected = reflectance(triangle, u, v), transmitted = transmittance(triangle, u, v);
  const double both = reflected.x + reflected.y + reflected.z + transmitted.x + transmitted.y + transmitted.z;
  if (!(both > 0.0)) return {};
  const double through = (transmitted.x + transmitted.y + transmitted.z) / both;
  if (chance >= through) return {reflected / (1.0 - through), false};
  return {transmitted / through, true};
}

/// What glass, and metal and gloss where textures tell of them, leave.
double Shading::diffusePart(const Triangle& triangle, double u, double v) const {
  double part = 1.0 - transmission(triangle, u, v);
  if (triangle.metallic > 0.0) part *= 1.0 - triangle.metallic * value(triangle.metal, u, v).z;
  if (triangle.specular != glm::dvec3(0.0)) {
    const auto specular = triangle.specular * glm::dvec3(colour(triangle.specular_texture, u, v));
    part *= 1.0 - std::max({specular.x, specular.y, specular.z});
  }
  return part;
}

double Shading::transmittedPart(const Triangle& triangle, double u, double v) const {
  return triangle.diffuse_transmission > 0.0
             ? triangle.diffuse_transmission * colour(triangle.transmission_part, u, v).w
             : 0.0;
}

glm::dvec3 Shading::Facing::at(double cosine) const {
  return straight + (along - straight) * std::pow(std::clamp(1.0 - cosine, 0.0, 1.0), 5.0);
}

Shading::Facing Shading::mirror(const Triangle& triangle, double u, double v) const {
  const double of_metal = metal(triangle, u, v), interface = triangle.mirror.interface;
  const double of_glass = interface > 0.0 ? 1.0 - of_metal : 0.0;
  return {of_metal * baseColour(triangle, u, v) + of_glass * interface, of_metal + of_glass};
}

double Shading::interfaceReflectance(const Triangle& triangle, double cosine) {
  const double interface = triangle.mirror.interface;
  return interface > 0.0 ? Facing{glm::dvec3(interface), 1.0}.at(cosine).x : 0.0;
}

double Shading::metal(const Triangle& triangle, double u, double v) const {
  const double factor = triangle.mirror.metallic;
  return factor > 0.0 ? factor * value(triangle.metal, u, v).z : 0.0;
}

double Shading::transmission(const Triangle& triangle, double u, double v) const {
  return triangle.transmission > 0.0 ? triangle.transmission * value(triangle.passing, u, v).x : 0.0;
}

double Shading::passing(const Triangle& triangle, double u, double v) const {
  return transmission(triangle, u, v) * (1.0 - metal(triangle, u, v));
}

glm::dvec3 Shading::baseColour(const Triangle& triangle, double u, double v) const {
  const auto result = triangle.mirror.colour * glm::dvec3(colour(triangle.base_colour, u, v));
  return triangle.coloured ? result * glm::dvec3(between(triangle.colours, u, v)) : result;
}

glm::dvec3 Shading::tint(const Triangle& triangle, double u, double v) const {
  return baseColour(triangle, u, v) * triangle.mirror.attenuation;
}

glm::dvec3 Shading::emission(const Triangle& triangle, double u, double v) const {
  return triangle.emission_lux * glm::dvec3(colour(triangle.emissive, u, v));
}

double Shading::opacity(const Triangle& triangle, double u, double v) const {
  if (!triangle.see_through) return 1.0;
  double alpha = triangle.alpha * colour(triangle.base_colour, u, v).w;
  if (triangle.coloured) alpha *= between(triangle.colours, u, v).w;
  if (triangle.cutoff >= 0.0) alpha = alpha >= triangle.cutoff ? 1.0 : 0.0;
  return alpha;
}

glm::dvec3 Shading::meanEmission(const Triangle& triangle) const {
  if (triangle.emissive.texture < 0) return triangle.emission_lux;
  constexpr int kSide = 16;
  constexpr double kLeast = 0.01;  // what shines between the places counts too
  glm::dvec3 sum(0.0);
  for (int i = 0; i < kSide; ++i) {
    for (int k = 0; k < kSide; ++k) {
      const double root = std::sqrt((i + 0.5) / kSide), w = (k + 0.5) / kSide;
      sum += emission(triangle, root * (1.0 - w), root * w);
    }
  }
  return sum / static_cast<double>(kSide * kSide) + kLeast * triangle.emission_lux;
}

}  // namespace radiosity::oracle
