// The node tree, which places meshes, cameras and lights, and the sky around it. Owned by one importScene call.
#pragma once

#include "server/scene/import/import_context.h"

namespace radiosity::scene {

/// Fills all of the Scene but for materials and textures, which are to be there.
[[nodiscard]] Result<void> importNodes(ImportContext& context);

}  // namespace radiosity::scene
