// What a lamp brings to a place when nothing stands between. Pure functions of values; any thread.
#pragma once

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/patches/lights.h"
#include "server/solver/rays/leaf_rays.h"

namespace radiosity::solver {

/// Form factor of the whole lamp; 0 behind it, and in its plane.
[[nodiscard]] double unhiddenLight(const LightPolygon& lamp, const LeafRays::Place& place);

/// The way from a place to a source, and what arrives, for an intensity of one, where nothing lies on it.
struct SourceLook {
  glm::dvec3 way{0.0};
  double brings = 0.0;
};
/// `at`: which point of a lamp with a size, uniform in [0, 1)^2; the mean of what they bring is unhiddenSource(). Not
/// of the sky.
[[nodiscard]] SourceLook lookAt(const PunctualLights::Source& source, const LeafRays::Place& place,
                                const glm::dvec2& at);

/// Irradiance for an intensity of one; 0 of the sky, which rays see where they end.
[[nodiscard]] double unhiddenSource(const PunctualLights::Source& source, const LeafRays::Place& place);

}  // namespace radiosity::solver
