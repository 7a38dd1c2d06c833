// Checks across arrays, after the schema and tinygltf: bounds of views and accessors, what attributes may be, the node
// tree. After this no reader can leave a buffer. Pure; any thread.
#pragma once

#include "server/scene/import/import_context.h"

namespace radiosity::scene {

[[nodiscard]] Result<void> checkModel(ImportContext& context);

}  // namespace radiosity::scene
