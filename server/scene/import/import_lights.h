// Lights of nodes that are no surfaces: KHR_lights_punctual, EXT_lights_area and EXT_lights_ies. Lives for one
// importScene call.
#pragma once

#include <glm/mat4x4.hpp>
#include <string>

#include "server/scene/import/import_context.h"

namespace radiosity::scene {

/// Adds the lights of a node (its JSON, checked by the schema) to the scene. `pointer`: of the node.
[[nodiscard]] Result<void> placeLights(ImportContext& context, const Json& node, const glm::dmat4& world,
                                       const std::string& pointer);

}  // namespace radiosity::scene
