// A picture of the sky as what solves ask of: lamps where it is bright, of which leaves draw directions in proportion
// to their light, and radiance by cell, which rays of reflected light find where they leave the scene. Pure functions.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/scene/values/scene.h"
#include "server/solver/lamps/punctual_lights.h"
#include "server/solver/math/sky_cells.h"

namespace radiosity::solver {

/// Of a sky with a picture; else none. `box`: what of its light enters there is its flux. `rays_see_sky`: the cells
/// come as a source of kind kSky, and lamps are what is brighter; else lamps are all of it. Cost: some ten thousand
/// sums.
[[nodiscard]] std::vector<PunctualLights::Source> pictureSources(const scene::Sky& sky,
                                                                 const std::array<glm::vec3, 2>& box,
                                                                 bool rays_see_sky);

/// Pi times the radiance of all that rays see of the sky, lm/m^2, by cell of SkyCells where there is a picture; else by
/// hemisphere alone, above the horizon and below.
struct SkyLight {
  std::array<glm::dvec3, 2> hemispheres{};
  std::vector<glm::vec3> cells;  ///< to be added; empty: none

  explicit SkyLight(std::span<const PunctualLights::Source> sources);
  [[nodiscard]] glm::dvec3 at(std::uint32_t cell) const {
    const auto& hemisphere = hemispheres[SkyCells::isAbove(cell) ? 0 : 1];
    return cells.empty() ? hemisphere : hemisphere + glm::dvec3(cells[cell]);
  }
};

}  // namespace radiosity::solver
