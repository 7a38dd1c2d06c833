// The tree of all triangles of a scene.
#pragma once

#include <memory>

#include "server/scene/bvh.h"
#include "server/scene/patch_scene.h"

namespace radiosity::scene {

/// Of triangles numbered as the scene's. O(n log n); any thread.
[[nodiscard]] std::shared_ptr<const Bvh> treeOf(const PatchScene& patches);

}  // namespace radiosity::scene
