// The lit scene as lightmaps of any quantity. Pure functions of the solver's present state; solve thread.
#pragma once

#include <vector>

#include "server/engine/lit_scene.h"
#include "server/scene/lightmap.h"

namespace radiosity::engine {

struct QuantityPages {
  Quantity quantity = Quantity::kIrradiance;
  std::vector<scene::LightmapPage>
      values;                ///< `irradiance` of each holds the quantity; empty where it is whole numbers
  std::vector<IdImage> ids;  ///< the other way round
  bool squared = false;      ///< `values` are squares: averaged as such, shown as roots

  [[nodiscard]] std::size_t size() const { return values.empty() ? ids.size() : values.size(); }
};

/// Costs a pass over all leaves and pages; irradiance also stitches seams.
[[nodiscard]] QuantityPages makePages(const LitScene& lit, Quantity quantity);

/// Root of each value, where `pages` holds squares; else as they are. What extrapolation made negative is 0.
[[nodiscard]] Image shown(const QuantityPages& pages, Image values);

}  // namespace radiosity::engine
