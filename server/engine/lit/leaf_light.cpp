#include "server/engine/lit/leaf_light.h"

#include <glm/common.hpp>

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

}  // namespace radiosity::engine
