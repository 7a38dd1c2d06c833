// Cuts flat faces along the walls that stand on them (wall_cuts.h says why). Pure; any thread.
#pragma once

#include <cstdint>
#include <vector>

#include "server/scene/charts/charts.h"
#include "server/scene/charts/flatten.h"
#include "server/scene/values/scene.h"
#include "server/scene/values/wall_cuts.h"

namespace radiosity::scene {

/// Cuts flat faces along walls that part them, or stand far into them, wherever a texel (of edge `texel`, unit box)
/// would have light of both sides. `flat`: of whole primitives; `neighbours`,
/// `facets`: its own; `kept`: by instance, such as stay
/// whole. So does what is see-through or posed. O(n log n), and bounded in time and in what it makes: faces that meet
/// more walls than a building has stay whole.
[[nodiscard]] WallCuts cutAlongWalls(const Scene& scene, const FlatScene& flat,
                                     const std::vector<std::uint32_t>& neighbours, const Facets& facets, double texel,
                                     const std::vector<bool>& kept);

}  // namespace radiosity::scene
