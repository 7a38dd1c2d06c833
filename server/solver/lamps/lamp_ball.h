// Where a lamp is, roughly: for tests of what may see it. Pure; any thread.
#pragma once

#include <glm/vec3.hpp>

#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/patches/lights.h"

namespace radiosity::solver {

/// Around a lamp, unit box; of one that is far the way towards it and the sine of its radius. Of a sky, which is all
/// around, the radius has no bound.
struct LampBall {
  glm::dvec3 centre{0.0};
  double radius = 0.0;
  bool is_far = false;
};
[[nodiscard]] LampBall ballOf(const LightPolygon& lamp);
[[nodiscard]] LampBall ballOf(const PunctualLights::Source& source);

}  // namespace radiosity::solver
