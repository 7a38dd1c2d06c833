// Materials and the textures they use. Owned by one importScene call.
#pragma once

#include "server/scene/import/import_context.h"

namespace radiosity::scene {

/// Fills Scene::materials (one for each /materials entry) and Scene::textures. Only images that decide how light is
/// reflected or emitted are decoded.
[[nodiscard]] Result<void> importMaterials(ImportContext& context);

}  // namespace radiosity::scene
