// The error of single texels: where the light of a solve is less sure. Pure functions of values; any thread.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/solver/error/error_parts.h"
#include "server/solver/patches/side.h"

namespace radiosity::solver {

/// Squares of the standard error of irradiance, lux^2 by channel, by node of level 0 (0 elsewhere). `first`, `second`:
/// irradiance of the two independent halves, `mean` of both, by node.
///
/// Sampling: the square of half the difference, shared out over the 5 x 5 leaves around by area. One difference is a
/// single draw and as often near 0 as not; the noise of neighbours has the same size, so their mean says more, and the
/// sum over a side stays what it was. Residual: the stated part of the scene's mean square, spread evenly over
/// the leaves: light that is missing elsewhere is missed in dark corners as much as in bright ones (measured: in
/// proportion to a leaf's own light it is 2.5 times too small for the quarter of the Cornell box with the least of it).
/// Variation: likewise. `common`: squares of what the halves have in common (Solver::commonErrorSquared()); where there
/// is some, light was smoothed over more leaves, whose noise goes together, so that half the difference is shared out
/// over 13 x 13. So the area-weighted mean of this, divided by that of irradiance squared, is total^2 of `stated` as
/// long as `stated` is of these halves. Cost: 20 or 52 additions a leaf.
[[nodiscard]] std::vector<glm::vec3> texelErrorSquared(const scene::PatchScene& patches,
                                                       std::span<const glm::vec3> first,
                                                       std::span<const glm::vec3> second,
                                                       std::span<const glm::vec3> mean, const ErrorParts& stated,
                                                       std::span<const glm::vec3> common = {});

}  // namespace radiosity::solver
