// Finds the closed solids of a scene (closed_solids.h). Pure; any thread.
#pragma once

#include "server/scene/values/closed_solids.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// Of vertices, triangles and what one can see through alone. Corners belong together when their positions are equal,
/// bit by bit.
[[nodiscard]] ClosedSolids findClosedSolids(const PatchScene& patches);

}  // namespace radiosity::scene
