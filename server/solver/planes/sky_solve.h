// The light of a scene under its sky alone, reflections included, for daylight factors: a small solve of its own beside
// the scene's, which has its lamps on. Pure function of values; any thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/solver/surface/place_light.h"

namespace radiosity::solver {

/// By node of level 0, lux; elsewhere 0.
struct SkySolution {
  std::vector<glm::vec3> irradiance;
  std::vector<glm::vec3> difference;  ///< of its two independent halves
};

/// `light`: of the scene with nothing but the sky. Every leaf gathers along rays of its own, drawn once; the equation
/// over them is solved by sweeps (Jacobi's method), which converge since surfaces reflect less than they get. Cost:
/// 2^23 rays, or 8 for each leaf where there are more than a million, and memory for half of them, 4 bytes each.
[[nodiscard]] SkySolution solveUnderSky(const PlaceLight& light, const scene::PatchScene& patches, std::uint64_t seed);

/// What arrives from the sky on level ground that nothing hides, lux, channels weighted. `light`: as above.
[[nodiscard]] double horizontalIlluminance(const PlaceLight& light);

}  // namespace radiosity::solver
