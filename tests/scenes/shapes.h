// Building blocks of the test scenes: boxes, spheres and furniture.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <string>

#include "tests/scenes/scene.h"

namespace radiosity::test_scenes {

/// Faces of a box, as bits: which of them to leave out where another solid or the floor touches.
enum BoxFace : unsigned { kNoFace = 0, kXMin = 1, kXMax = 2, kYMin = 4, kYMax = 8, kZMin = 16, kZMax = 32 };

/// Six materials in the order of BoxFace.
using BoxMaterials = std::array<std::uint32_t, 6>;
[[nodiscard]] BoxMaterials allFaces(std::uint32_t material);

/// Appends the faces of the box [low, high], facing outwards (or inwards: a closed room).
void appendBox(Object& object, glm::dvec3 low, glm::dvec3 high, const BoxMaterials& materials,
               unsigned left_out = kNoFace, bool inwards = false);

/// A sphere of triangles: an icosahedron subdivided `subdivisions` times, blown up a little so that its area is exactly
/// 4 pi radius^2. Faces outwards unless `inwards`. `smooth`: with the sphere's normals.
void appendSphere(Object& object, glm::dvec3 centre, double radius, unsigned subdivisions, std::uint32_t material,
                  bool inwards, bool smooth = false);

/// An upright prism of so many sides whose corners lie on a circle, with flat ends; its sides have the normals of a
/// cylinder. Faces outwards; stands on `foot`.
void appendCylinder(Object& object, glm::dvec3 foot, double radius, double height, unsigned sides,
                    std::uint32_t material);

/// Turns the object about the vertical through its origin.
void turn(Object& object, double angle_rad);
void move(Object& object, glm::dvec3 by);

/// 27 polygons: four legs (sides only), a seat box, a back that stands on the seat. Origin on the floor under the
/// middle of the seat; the sitter looks along +Z.
[[nodiscard]] Object makeChair(std::string name, std::uint32_t frame_material, std::uint32_t seat_material);

/// 22 polygons: four legs (sides only) and a top. Origin on the floor under the middle.
[[nodiscard]] Object makeTable(std::string name, double width_x, double depth_z, std::uint32_t leg_material,
                               std::uint32_t top_material);

/// 6 polygons: a closed flat box whose underside shines. Origin in the middle of the underside.
[[nodiscard]] Object makeCeilingLamp(std::string name, glm::dvec3 origin, double width_x, double depth_z,
                                     std::uint32_t body_material, std::uint32_t light_material);

}  // namespace radiosity::test_scenes
