// Where mirrors send rays, smooth and rough ones. Pure.
#pragma once

#include <glm/vec3.hpp>
#include <map>
#include <optional>
#include <vector>

#include "tests/oracle/random.h"
#include "tests/oracle/shading.h"

namespace radiosity::oracle {

/// What a white mirror of some roughness reflects by single bounces between its microfacets.
class RoughMirror {
 public:
  explicit RoughMirror(double roughness);

  [[nodiscard]] double width() const { return width_; }
  /// At an angle of this cosine, and in the mean.
  [[nodiscard]] double kept(double cosine) const;
  [[nodiscard]] double mean() const { return mean_; }

 private:
  double width_, mean_ = 0.0;
  std::vector<double> kept_;
};

/// Of a ray that travels along `direction`, by chance. `part` is multiplied by what the mirror reflects of it, for a
/// direction drawn so: microfacets as Walter et al. 2007 draw them; what their masking takes of white light is given
/// back, once more reflected for each bounce (Kulla and Conty 2017, Turquin 2019). `mirror`: of the same roughness.
[[nodiscard]] glm::dvec3 reflect(const glm::dvec3& normal, const glm::dvec3& direction, const Shading::Facing& facing,
                                 const RoughMirror& mirror, glm::dvec3& part, Random& random);

/// Mirrors and glass of a scene.
class Mirrors {
 public:
  /// A roughness that its triangles have.
  void add(double roughness) { rough_.try_emplace(roughness, roughness); }

  /// Where a ray meets a triangle; the normal is on the ray's side.
  struct Place {
    glm::dvec3 position, normal;
    bool is_back = false;
  };
  /// Where it goes from a mirror, or through glass; none: it is scattered. By chance, which `part` makes up for.
  [[nodiscard]] std::optional<glm::dvec3> goOn(const Shading& shading, const Triangle& triangle, const Place& place,
                                               const glm::dvec3& direction, glm::dvec3& part, Random& random) const;

 private:
  std::map<double, RoughMirror> rough_;
};

}  // namespace radiosity::oracle
