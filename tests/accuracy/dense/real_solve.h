// The real solver, with its OpenGL transport in process, and the dense one, which shares no code with it, on the very
// same patches: a patch of the dense solver is a texel of the real one. Throws std::runtime_error when something on the
// way fails. For scenes of quadrilaterals whose texels are all whole.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/method.h"
#include "server/solver/solver.h"
#include "tests/oracle/dense_solver.h"
#include "tests/scenes/scene.h"

namespace radiosity::accuracy {

struct SolveOptions {
  double texel_size_m = 0.125;
  double target_error = 0.01;
  Method method = Method::kGather;
  std::uint64_t seed = 1;
};

/// One texel with area.
struct SolvedTexel {
  oracle::DensePatch patch;        ///< in metres
  glm::dvec3 irradiance_lux{0.0};  ///< what the real solver found
  std::uint32_t surface = 0, x = 0, y = 0;
};

struct RealSolve {
  std::vector<SolvedTexel> texels;
  solver::ErrorParts stated;
  solver::EnergyParts energy;
  std::uint32_t rounds = 0;

  [[nodiscard]] std::vector<oracle::DensePatch> patches() const;
};

/// From GLB through importer and charts to the solver's end.
[[nodiscard]] RealSolve solveReally(const test_scenes::TestScene& scene, const SolveOptions& options);

struct Difference {
  double rms = 0.0;      ///< relative RMS over texels and channels, by area; what the stated error estimates
  double worst = 0.0;    ///< largest difference of a texel from the dense value, of the scene's RMS irradiance
  double bias = 0.0;     ///< all light received, relative
  double surface = 0.0;  ///< largest difference of a surface's mean, of the scene's RMS irradiance
};
[[nodiscard]] Difference compare(const RealSolve& solve, std::span<const glm::dvec3> dense_irradiance_lux);

/// How much irradiance varies inside the texels: relative RMS over all of them of the differences between points of a
/// texel and the texel's mean, by the light of `dense`. A solver that looks at one random point of each texel a round,
/// and averages R rounds, is off by this / sqrt(R).
[[nodiscard]] double spreadInsideTexels(const RealSolve& solve, const oracle::DenseSolution& dense,
                                        std::span<const oracle::Corners> occluders);

/// How much irradiance varies inside blocks of `side` x `side` texels: relative RMS of the differences between a texel
/// and its block's mean. What a solver loses that links light to such blocks.
[[nodiscard]] double spreadInsideBlocks(const RealSolve& solve, std::span<const glm::dvec3> dense_irradiance_lux,
                                        std::uint32_t side);

}  // namespace radiosity::accuracy
