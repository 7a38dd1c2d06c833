// Writes glTF's defaults into the JSON, so that a patch finds the member it wants to replace. Pure; any thread.
#pragma once

#include "server/scene/document/json_text.h"

namespace radiosity::scene {

/// Nodes get translation, rotation, scale (a `matrix` is decomposed, unless it shears); materials get their factors,
/// alpha members, doubleSided and emissiveStrength. Members that are there stay, whatever their type: the schema check
/// judges them.
void materialiseDefaults(Json& gltf);

}  // namespace radiosity::scene
