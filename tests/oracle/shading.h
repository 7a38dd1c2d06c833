// What a surface reflects, emits and lets through at a place: factors, textures and colours of its corners together.
// Immutable; any thread.
#pragma once

#include <glm/vec3.hpp>
#include <utility>
#include <vector>

#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {

/// Nothing reflects more: paths would not end.
inline constexpr double kMostReflectance = 0.999;

class Shading {
 public:
  /// Keeps its own copy of the triangles.
  explicit Shading(const TriangleScene& scene) : triangles_(scene.triangles), textures_(scene.textures) {}

  [[nodiscard]] const std::vector<Triangle>& triangles() const { return triangles_; }

  /// (u, v): weights of the triangle's second and third corner, here and below.
  [[nodiscard]] static std::pair<double, double> weights(const Triangle& triangle, const glm::dvec3& position);

  [[nodiscard]] glm::dvec3 reflectance(const Triangle& triangle, double u, double v) const;
  /// The same as if nothing were transmitted diffusely: by what an engine that does not know of that multiplies light.
  [[nodiscard]] glm::dvec3 baseReflectance(const Triangle& triangle, double u, double v) const;
  /// Of light on the other side, what leaves diffusely on this one.
  [[nodiscard]] glm::dvec3 transmittance(const Triangle& triangle, double u, double v) const;
  /// Where a path goes on, `chance` being uniform in [0, 1): on the other side or not, and of what leaves there, what
  /// the light contributes that arrives.
  struct Scattered {
    glm::dvec3 part{0.0};
    bool is_other_side = false;
  };
  [[nodiscard]] Scattered scatter(const Triangle& triangle, double u, double v, double chance) const;
  [[nodiscard]] glm::dvec3 emission(const Triangle& triangle, double u, double v) const;  ///< lux
  /// What it reflects as a mirror, of light straight at it and of light along it.
  struct Facing {
    glm::dvec3 straight{0.0};
    double along = 0.0;
    [[nodiscard]] bool any() const { return along > 0.0 || straight != glm::dvec3(0.0); }
    /// Schlick 1994.
    [[nodiscard]] glm::dvec3 at(double cosine) const;
  };
  /// Of a place that is partly metal: of both parts.
  [[nodiscard]] Facing mirror(const Triangle& triangle, double u, double v) const;
  /// What the interface of glass alone reflects, of all channels alike; 0 of what is no glass.
  [[nodiscard]] static double interfaceReflectance(const Triangle& triangle, double cosine);
  /// Of light that enters a face, the part that is not scattered there, nor stopped by metal.
  [[nodiscard]] double passing(const Triangle& triangle, double u, double v) const;
  /// Of light that goes on through a face of glass.
  [[nodiscard]] glm::dvec3 tint(const Triangle& triangle, double u, double v) const;
  [[nodiscard]] double opacity(const Triangle& triangle, double u, double v) const;

  /// Over the triangle, estimated at some places; above 0 where the triangle can shine at all.
  [[nodiscard]] glm::dvec3 meanEmission(const Triangle& triangle) const;

 private:
  [[nodiscard]] const Texture* textureOf(const TextureUse& use) const {
    return use.texture < 0 ? nullptr : &textures_[static_cast<std::size_t>(use.texture)];
  }
  [[nodiscard]] glm::dvec4 colour(const TextureUse& use, double u, double v) const;
  /// As stored: of textures that hold no colours. One without a texture.
  [[nodiscard]] glm::dvec4 value(const TextureUse& use, double u, double v) const;
  [[nodiscard]] glm::dvec3 baseColour(const Triangle& triangle, double u, double v) const;
  [[nodiscard]] double transmission(const Triangle& triangle, double u, double v) const;
  [[nodiscard]] double metal(const Triangle& triangle, double u, double v) const;
  [[nodiscard]] double diffusePart(const Triangle& triangle, double u, double v) const;
  [[nodiscard]] double transmittedPart(const Triangle& triangle, double u, double v) const;

  std::vector<Triangle> triangles_;
  std::vector<Texture> textures_;
};

}  // namespace radiosity::oracle
