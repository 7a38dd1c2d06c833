// A furnished room of the program's own, on which is tried what is faster on a machine. The same everywhere.
#pragma once

#include <memory>

#include "common/result.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// About 3,000 triangles and 8,000 texels. Takes some 50 ms.
[[nodiscard]] Result<std::shared_ptr<const PatchScene>> makeTrialRoom();

}  // namespace radiosity::scene
