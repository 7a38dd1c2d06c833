#include "server/engine/lit/leaf_light.h"

#include <glm/common.hpp>

#include "server/scene/lightmap/translucent_texels.h"

namespace radiosity::engine {

scene::LeafLight leafLight(const solver::Solver& solver, const SolveSettings& settings) {
  scene::LeafLight light{solver.irradiance()};
  for (auto& value : light.mean) value = glm::max(value, 0.0F);
  light.is_shown_as_is = settings.method == Method::kPaper || settings.texels_are_means;
  if (light.is_shown_as_is) return light;
  light.difference = solver.halfIrradiance(0);
  const auto second = solver.halfIrradiance(1);
  for (std::size_t n = 0; n < second.size(); ++n) light.difference[n] -= second[n];
  return light;
}

scene::LeafLight showThrough(scene::LeafLight light, const scene::PatchScene& patches,
                             const scene::PatchMaterials& materials) {
  scene::joinTranslucentSides(patches, materials, light.mean);
  scene::joinTranslucentSides(patches, materials, light.difference);
  return light;
}

}  // namespace radiosity::engine
