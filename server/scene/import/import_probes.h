// Grids of probes: /nodes/N/extras/radiosityProbes, our own. They are read of the document and are no part of the
// Scene, since nothing of its light depends on them. Pure; any thread.
#pragma once

#include <vector>

#include "server/scene/document/document.h"
#include "server/scene/values/probe_grid.h"

namespace radiosity::scene {

/// Of the nodes that the document shows and that are visible, in the order of the node tree; those of hidden nodes are
/// checked alone. A grid is a box around its node's origin, along its axes. `document`: its nodes are checked, as
/// import does. Errors name the member. O(nodes), little where there are no grids.
[[nodiscard]] Result<std::vector<ProbeGrid>> readProbeGrids(const Document& document);

}  // namespace radiosity::scene
