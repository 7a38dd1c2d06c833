// The lit scene as lightmaps of any quantity. Reading the solver's present state is the solve thread's; pages can be
// assembled of what was read anywhere.
#pragma once

#include <vector>

#include "server/engine/lit/lit_scene.h"
#include "server/scene/lightmap/lightmap.h"

namespace radiosity::engine {

struct QuantityPages {
  Quantity quantity = Quantity::kIrradiance;
  std::vector<scene::LightmapPage>
      values;                ///< `irradiance` of each holds the quantity; empty where it is whole numbers
  std::vector<IdImage> ids;  ///< the other way round
  bool squared = false;      ///< `values` are squares: averaged as such, shown as roots

  [[nodiscard]] std::size_t size() const { return values.empty() ? ids.size() : values.size(); }
};

/// A quantity as the solver has it at one moment.
struct QuantityValues {
  Quantity quantity = Quantity::kIrradiance;
  /// By node; of radiosity what is emitted. Empty where the quantity is irradiance, or whole numbers.
  std::vector<glm::vec3> nodes;
  std::vector<IdImage> ids;     ///< finished pages of those
  bool squared = false;         ///< as QuantityPages::squared
  scene::LeafLight light = {};  ///< of irradiance and radiosity: to be fitted to texels, away from the solve thread
  std::vector<glm::vec3> reflectance = {};    ///< of radiosity, by node
  std::vector<glm::vec3> transmittance = {};  ///< likewise; empty: nothing is translucent
};

/// Costs a pass over all leaves.
[[nodiscard]] QuantityValues readQuantity(const LitScene& lit, Quantity quantity);
/// Costs a pass over all pages; irradiance also stitches seams. `patches`: of the scene that was read. Any thread.
[[nodiscard]] QuantityPages assemble(const scene::PatchScene& patches, QuantityValues values);
/// Both.
[[nodiscard]] QuantityPages makePages(const LitScene& lit, Quantity quantity);

/// Root of each value, where `pages` holds squares; else as they are. What extrapolation made negative is 0.
[[nodiscard]] Image shown(const QuantityPages& pages, Image values);

}  // namespace radiosity::engine
