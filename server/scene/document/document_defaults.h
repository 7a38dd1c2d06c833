// Writes glTF's defaults into the JSON, so that a patch finds the member it wants to replace. Pure; any thread.
#pragma once

#include "server/scene/document/json_text.h"
#include "server/scene/document/touched_parts.h"

namespace radiosity::scene {

/// Nodes get translation, rotation, scale (a `matrix` is decomposed, unless it shears); materials get their factors,
/// alpha members, doubleSided and emissiveStrength. Members that are there stay, whatever their type: the schema check
/// judges them. After an edit: of `parts` alone, where all else has them.
void materialiseDefaults(Json& gltf, const TouchedParts& parts = {});

}  // namespace radiosity::scene
