// Measuring planes: /nodes/N/extras/radiosityPlane, our own. They are read of the document and are no part of the
// Scene, since nothing of its light depends on them. Pure; any thread.
#pragma once

#include <vector>

#include "server/scene/document/document.h"
#include "server/scene/values/measuring_plane.h"

namespace radiosity::scene {

/// Of the nodes that the document shows and that are visible, in the order of the node tree; those of hidden nodes are
/// checked alone. A plane lies in its node's x-z plane around the node's origin and looks along +y; columns go along x,
/// rows along z. `document`: its nodes are checked, as import does. Errors name the member. O(nodes), little where
/// there are no planes.
[[nodiscard]] Result<std::vector<MeasuringPlane>> readPlanes(const Document& document);

}  // namespace radiosity::scene
