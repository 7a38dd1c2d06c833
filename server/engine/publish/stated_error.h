// What is told beside light that was measured at places off the surfaces. Pure functions.
#pragma once

#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "server/engine/lit/lit_scene.h"

namespace radiosity::engine {

/// Part of all light that is unshot, or lost by texels that are too wide and by smoothing: an error that no halves of a
/// solve differ by. 1 while it is not known. `light`: lux, by node of level 0. O(nodes); solve thread.
[[nodiscard]] double systematicPart(const LitScene& lit, const std::vector<glm::vec3>& light);

/// At most 100 bytes of a name, cut between characters.
[[nodiscard]] std::string shortName(std::string name);

}  // namespace radiosity::engine
