// The sky of a document: two colours, a picture, or daylight by a model. Owned by one importScene call.
#pragma once

#include "server/scene/import/import_context.h"

namespace radiosity::scene {

/// /extras/radiositySky, our own, so that a sky is part of the scene and can be patched; without it that of
/// EXT_lights_image_based or KHR_environment_map. Pictures are read once, and edits find them again.
[[nodiscard]] Result<void> importSky(ImportContext& context);

}  // namespace radiosity::scene
