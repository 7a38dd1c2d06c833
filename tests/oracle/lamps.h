// Lights that are no surfaces as the oracle has them: KHR_lights_punctual and EXT_lights_area read anew. Pure.
#pragma once

#include <glm/vec3.hpp>

#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {

struct LampLight {
  glm::dvec3 irradiance{0.0};  ///< lux, were nothing in the way
  glm::dvec3 direction{0.0};   ///< unit, to the lamp
  double distance = 0.0;       ///< metres; infinite for a sun
};

/// I cos / d^2 with the cone and range of KHR_lights_punctual; E cos of a sun. Of a lamp with a size: from one of its
/// points, uniform by area where `u` and `v` are in [0, 1), as if all of it were there.
[[nodiscard]] LampLight lightOf(const Lamp& lamp, const glm::dvec3& position, const glm::dvec3& normal, double u,
                                double v);

}  // namespace radiosity::oracle
