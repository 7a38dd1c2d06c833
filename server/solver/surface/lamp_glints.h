// Lamps as they are seen in rough metal, by looks at the lamps from where a ray met the metal: rays that metal reflects
// by chance meet small lamps seldom. What both find is weighed by the balance heuristic (Veach 1997), so that nothing
// counts twice. Immutable; any thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/solver/patches/lights.h"
#include "server/solver/rays/specular_leaves.h"
#include "server/solver/surface/mirror_walk.h"
#include "server/solver/surface/tinted_rays.h"

namespace radiosity::solver {

class LampGlints {
 public:
  /// None: nothing is looked at, and all that rays meet counts in full.
  LampGlints() = default;
  explicit LampGlints(std::vector<LightPolygon> lamps);

  /// Radiosity, lm/m^2, that a ray which met metal brings of a lamp seen in it, by one look: but for what rays bring
  /// that go on from there. Cost: one ray, where the metal is rough.
  [[nodiscard]] glm::dvec3 look(const TintedRays& rays, const SpecularLeaves& mirrors, const RayEnd& at) const;
  /// What a ray that went on from `metal` counts that met a lamp of this emission there.
  [[nodiscard]] double weightOf(const SpecularLeaves& mirrors, const RayEnd& metal, const RayEnd& lamp,
                                const glm::vec3& emission) const;

 private:
  [[nodiscard]] static bool isRough(const SpecularLeaves& mirrors, std::uint32_t value);
  [[nodiscard]] double density(const glm::vec3& emission, const glm::dvec3& normal, const glm::dvec3& way) const;

  std::vector<LightPolygon> lamps_;
  std::vector<double> up_to_;  ///< by lamp: of its power and that of those before
};

}  // namespace radiosity::solver
