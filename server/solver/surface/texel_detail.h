// How fine texels are to be, surface by surface, so that lookups in lightmaps are as good as asked with as few of them
// as may be. Pure functions of values; any thread.
//
// What a surface's texels hide is told by how its light bends from texel to texel, at their own size and at twice that:
// where it bends evenly, the error of lookups falls with the fourth power of the size of texels, and at the edge of a
// shadow with the first. How much that comes to in all is what was measured at the surface. The least number of texels
// has the same gain for one more texel everywhere (Lagrange).
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/solver/surface/surface_error.h"

namespace radiosity::solver {

struct DetailGoal {
  double error = 0.0;        ///< by texels alone, relative to the RMS of irradiance
  double most_texels = 0.0;  ///< that surfaces may have in all
};

struct TexelDetail {
  std::vector<float> of_surface;  ///< Surface::detail that each should have
  double error = 0.0;             ///< that is likely to be left, by texels alone
  double present = 0.0;           ///< likewise of those that there are
  double texels = 0.0;            ///< that surfaces have then, about
};

/// What a solver knows, by node.
struct TexelLight {
  std::span<const glm::vec3> first, second;  ///< irradiance of the two independent halves
  std::span<const glm::vec3> common;         ///< Solver::commonErrorSquared()
};

/// `measured`: at the surface, with the texels that there are. Cost: some passes over the leaves.
[[nodiscard]] TexelDetail chooseDetail(const scene::PatchScene& patches, const TexelLight& light,
                                       std::span<const SurfaceError::Measured> measured, const DetailGoal& goal);

}  // namespace radiosity::solver
