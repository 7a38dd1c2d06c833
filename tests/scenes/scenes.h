// The scenes themselves, with parameters. Each is a pure function of its arguments.
#pragma once

#include <functional>
#include <glm/vec3.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tests/scenes/scene.h"

namespace radiosity::test_scenes {

/// The Cornell box as measured at Cornell's Program of Computer Graphics (published vertices and spectra), in metres,
/// with the front open as the original. The light shines through a hole of its size in the ceiling, where it lies flush
/// in the original, so that no two faces coincide. The camera is the published one: red left, green right.
[[nodiscard]] TestScene cornell();

/// A closed cube, facing inwards, the same reflectance and emission everywhere: H = pi L / (1 - rho) on every point.
[[nodiscard]] TestScene furnace(glm::dvec3 reflectance, glm::dvec3 emission_nits, double side_m = 1.0);

/// A unit cube, facing inwards, whose floor alone shines with radiosity 1 (luminance 1 / pi).
[[nodiscard]] TestScene lumpedCube(double reflectance);

/// Two rectangles width_x by depth_z that face each other at a distance: the lower shines, the upper receives.
[[nodiscard]] TestScene parallelPlates(double width_x, double depth_z, double distance, double emission_nits,
                                       double reflectance);

/// Two rectangles that share an edge of length `edge` at 90 degrees: the floor (edge x depth) receives, the wall
/// (edge x height) shines.
[[nodiscard]] TestScene perpendicularPlates(double edge, double depth, double height, double emission_nits,
                                            double reflectance);

/// A box 4 m by 4 m and 1 m high whose floor shines, with a face of glass of this tint across the middle of its height.
/// Its walls are perfect mirrors, so that floor, glass and ceiling are as if they had no end: of light from all around
/// the face reflects R = 0.04 + 0.96 / 21 and passes T = (1 - R) x tint, and with B = E + reflectance x H on the floor,
/// B' = reflectance x H' on the ceiling, H = R B + T B' and H' = R B' + T B.
[[nodiscard]] TestScene tintedBox(double reflectance, glm::dvec3 emission_nits, glm::dvec3 tint);

struct SphereSpec {
  double radius_m = 1.0;
  double reflectance = 0.5;
  double emission_nits = 0.0;
};
/// A sphere that faces outwards inside one that faces inwards; both tessellated to the exact area of the sphere.
[[nodiscard]] TestScene concentricSpheres(const SphereSpec& inner, const SphereSpec& outer, unsigned subdivisions = 3);

/// Closed room of 402 polygons like figure 1 of Lum, Ma and Max 2002: three tables, twelve chairs, a ceiling lamp.
[[nodiscard]] TestScene smallRoom();

/// The small room with a bulb and a spot light (KHR_lights_punctual) in place of its lamp.
[[nodiscard]] TestScene lightsRoom();

/// The small room with a panel, a disc (EXT_lights_area) and a globe (a point light with a radius) in place of its
/// lamp.
[[nodiscard]] TestScene areaRoom();

/// Closed seminar room of 3,138 polygons like their figure 2: 42 tables, 80 chairs, eight ceiling lamps.
[[nodiscard]] TestScene seminarRoom();

/// The same scene as many modellers export it: every surface double-sided, but for those that shine. These stay as they
/// are, since a lamp whose other side shone too would be another lamp. What can be seen from within is as bright.
[[nodiscard]] TestScene doubleSidedTwin(TestScene scene);

/// Closed room with a lamp, a ball of 80 facets that hovers and a barrel of twelve sides, both with smooth normals.
[[nodiscard]] TestScene smoothRoom();

/// Everything that make_scenes writes, by file name without extension.
[[nodiscard]] std::vector<std::pair<std::string, std::function<TestScene()>>> allScenes();

}  // namespace radiosity::test_scenes
