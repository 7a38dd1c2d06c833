// How much of what a shooter sends an edit of geometry can have moved elsewhere. Pure functions, any thread.
#pragma once

#include <glm/vec3.hpp>
#include <span>

#include "server/scene/patch_scene.h"

namespace radiosity::solver {

/// Part of what a small patch sends that passes a box, with nothing in between: by Lambert's formula over the faces
/// that it sees, cut off at its horizon. 1 for a patch inside. O(1), about a microsecond.
[[nodiscard]] double throughBox(const glm::vec3& origin, const glm::vec3& normal, const scene::ChangedBox& box);

/// Bound of the area-weighted norm of the change of all links of a shooter of this area (unit box squared; `low` and
/// `high` are the box around it), as they look from `origin`, where nothing changed but what passes the boxes. What is
/// taken from some leaves goes to others, each at most all that passes, and no link is larger than the shooter looks
/// from the nearest point of a box.
[[nodiscard]] double changeReach(const glm::vec3& origin, const glm::vec3& normal, const scene::ChangedBox& shooter,
                                 double area, std::span<const scene::ChangedBox> boxes);

}  // namespace radiosity::solver
