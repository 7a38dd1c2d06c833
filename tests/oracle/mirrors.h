// Where mirrors send rays, smooth and rough ones. Pure.
#pragma once

#include <glm/vec3.hpp>
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

}  // namespace radiosity::oracle
