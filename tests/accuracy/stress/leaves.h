// Leaves of a solve in process by where they are, and how far their light is from the path tracer's.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/charts/build.h"
#include "server/solver/solver.h"
#include "tests/accuracy/stress/stress_solve.h"
#include "tests/oracle/path_tracer.h"
#include "tests/scenes/scene.h"

namespace radiosity::accuracy {

[[nodiscard]] solver::SolverSettings settingsOf(double target);

/// Of whole leaves alone: area, normal and light. Metres.
struct LeafAt {
  oracle::Footprint footprint;
  glm::dvec3 middle, light;
  std::uint32_t instance;
};
[[nodiscard]] std::vector<LeafAt> wholeLeaves(const Solve& solve);

[[nodiscard]] scene::ChartOptions texelsOf(double metres);

/// Of all light, relative RMS against the path tracer at every `step`-th whole leaf, but for the tracer's own noise.
/// Expects the mean to be that of the tracer within 1.5 %.
[[nodiscard]] double offFromPathTracer(const Solve& solve, const test_scenes::TestScene& scene, std::size_t step,
                                       std::uint32_t samples);

}  // namespace radiosity::accuracy
