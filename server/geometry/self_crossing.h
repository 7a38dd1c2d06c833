// Whether a surface of triangles keeps clear of itself. Pure functions of values.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <span>

namespace radiosity::scene {

using Corners = std::array<glm::vec3, 3>;

/// True: triangles of a closed surface meet nowhere but in corners and edges that they share. False: some cross or
/// touch elsewhere, or too many lie near each other to be told within a time that grows as their number does.
[[nodiscard]] bool keepsClearOfItself(std::span<const Corners> triangles);

}  // namespace radiosity::scene
