// Scenes whose irradiance is known without tracing a path. Pure function.
#pragma once

#include <glm/vec3.hpp>
#include <optional>

#include "tests/oracle/triangle_scene.h"

namespace radiosity::accuracy {

/// The irradiance, in lux, everywhere in a cavity closed by one connected surface that faces inwards and has the same
/// reflectance and emission all over: H = E / (1 - rho), whatever its shape. Nothing when the scene is anything else.
[[nodiscard]] std::optional<glm::dvec3> cavityIrradiance(const oracle::TriangleScene& scene);

}  // namespace radiosity::accuracy
