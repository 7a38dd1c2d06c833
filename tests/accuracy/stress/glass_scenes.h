// Scenes with panes and bulbs of glass, and what closed forms say of them.
#pragma once

#include <glm/vec3.hpp>
#include <vector>

#include "tests/accuracy/stress/stress_solve.h"
#include "tests/scenes/scene.h"

namespace radiosity::accuracy {

/// Smooth, and all that it does not reflect goes through, tinted.
[[nodiscard]] test_scenes::Material glassOf(const glm::dvec3& colour, bool is_double_sided = true);

/// Part of the light at an angle that a face of an index of 1.5 reflects, as told without the code under test.
[[nodiscard]] double reflectanceAt(double cosine);

/// A black floor right below panes as wide, two centimetres between each and the next, so that they show nothing but
/// the floor, in a room all of whose walls shine with one nit, or under nothing.
[[nodiscard]] test_scenes::TestScene floorBelow(const std::vector<test_scenes::Material>& panes, bool has_walls);

/// Of the floor far from its edges.
[[nodiscard]] glm::dvec3 meanOnFloor(const Solve& solve);

/// A lamp in a bulb of this, in a closed room.
[[nodiscard]] test_scenes::TestScene roomWithBulb(const test_scenes::Material& material);

}  // namespace radiosity::accuracy
