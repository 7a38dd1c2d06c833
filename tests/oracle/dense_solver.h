// Radiosity the plain way: every form factor in a matrix, solved to the last digits. The oracle of the fast path on
// small scenes. Double precision.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "tests/oracle/form_factors.h"
#include "tests/scenes/scene.h"

namespace radiosity::oracle {

struct DensePatch {
  Corners corners;
  glm::dvec3 reflectance{0.0};
  glm::dvec3 emission_lux{0.0};  ///< radiosity E
};

/// Row-major n x n: at [i * n + j], F(i, j).
using FormFactorMatrix = std::vector<double>;

/// All pairs, the lower triangle by reciprocity. What `occluders` hide (exact shadow pyramids) is left out; give them
/// as large polygons, not as patches: each cuts what is seen into more pieces.
[[nodiscard]] FormFactorMatrix formFactors(std::span<const DensePatch> patches, std::span<const Corners> occluders = {},
                                           const IntegrationOptions& options = {});

struct DenseSolution {
  std::vector<glm::dvec3> irradiance_lux;  ///< H
  std::vector<glm::dvec3> radiosity_lux;   ///< B = E + rho H
};

/// B_i = E_i + rho_i sum_j F_ij B_j by Gauss-Seidel until no B changes by more than 1e-14 of the largest.
[[nodiscard]] DenseSolution solveDense(std::span<const DensePatch> patches, const FormFactorMatrix& factors);

/// Every polygon of the scene with three or four corners cut into about equal patches no longer than `max_edge_m`
/// (infinity: a patch a polygon).
[[nodiscard]] std::vector<DensePatch> makePatches(const test_scenes::TestScene& scene, double max_edge_m);

/// Every polygon of the scene, for `occluders`.
[[nodiscard]] std::vector<Corners> allPolygons(const test_scenes::TestScene& scene);

}  // namespace radiosity::oracle
