// Measuring planes: what they need is read on the solve thread, and they are measured on any other. Pure functions.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "common/result.h"
#include "server/engine/engine.h"
#include "server/engine/lit/lit_scene.h"
#include "server/scene/values/measuring_plane.h"

namespace radiosity::engine {

/// Of one moment; shared parts stay as they are.
struct PlaneParts {
  std::vector<scene::MeasuringPlane> planes;  ///< that are asked for
  std::shared_ptr<const scene::PatchScene> patches;
  scene::PatchMaterials materials;
  solver::LightSources sources;
  std::vector<glm::vec3> irradiance, difference;  ///< lux, by node of level 0; what the halves of the solve differ by
  double systematic = 1.0;                        ///< solver::planeFigures()
  std::uint64_t seed = 1;
};

/// kNotFound where a plane of that name is asked for and there is none. Cost: a copy of the light. Without planes none.
[[nodiscard]] Result<PlaneParts> readPlanes(const LitScene& lit, const MeasureRequest& request);

/// To a standard error of 1 % of the mean, as RMS over the points, or what rays within bounds come to. Cost: a ray tree
/// of the scene, and PlaneRays; solver::solveUnderSky() where daylight factors are asked for. On all cores, with
/// interruption points.
[[nodiscard]] std::vector<MeasuredPlane> measurePlanes(const PlaneParts& parts, const MeasureRequest& request);

}  // namespace radiosity::engine
