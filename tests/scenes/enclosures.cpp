#include <numbers>

#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::test_scenes {

TestScene furnace(glm::dvec3 reflectance, glm::dvec3 emission_nits, double side_m) {
  TestScene scene;
  scene.name = "furnace";
  const auto wall = scene.add({"wall", reflectance, emission_nits});
  Object cube{"cube", {}, {}};
  appendBox(cube, glm::dvec3(0.0), glm::dvec3(side_m), allFaces(wall), kNoFace, true);
  scene.objects.push_back(std::move(cube));
  scene.camera = {glm::dvec3(0.5, 0.5, 0.9) * side_m, glm::dvec3(0.5, 0.5, 0.0) * side_m, 1.2, 1.0};
  return scene;
}

TestScene lumpedCube(double reflectance) {
  auto scene = furnace(glm::dvec3(reflectance), glm::dvec3(0.0));
  scene.name = "lumped_cube";
  const auto light = scene.add({"light", glm::dvec3(reflectance), glm::dvec3(1.0 / std::numbers::pi)});
  scene.objects[0].polygons[2].material = light;  // the face y = 0
  return scene;
}

TestScene parallelPlates(double width_x, double depth_z, double distance, double emission_nits, double reflectance) {
  TestScene scene;
  scene.name = "plates_parallel";
  const auto light = scene.add({"light", glm::dvec3(reflectance), glm::dvec3(emission_nits)});
  const auto grey = scene.add({"grey", glm::dvec3(reflectance), glm::dvec3(0.0)});
  const double d = distance;
  Object lower{"lower", {}, {}};
  lower.polygons.push_back({{{0, 0, 0}, {0, 0, depth_z}, {width_x, 0, depth_z}, {width_x, 0, 0}}, light});
  Object upper{"upper", {0.0, d, 0.0}, {}};
  upper.polygons.push_back({{{0, d, 0}, {width_x, d, 0}, {width_x, d, depth_z}, {0, d, depth_z}}, grey});
  scene.objects = {lower, upper};
  scene.camera = {{width_x / 2, distance / 2, 3.0 * depth_z + distance}, {width_x / 2, distance / 2, 0.0}, 0.8, 1.0};
  return scene;
}

TestScene perpendicularPlates(double edge, double depth, double height, double emission_nits, double reflectance) {
  TestScene scene;
  scene.name = "plates_perpendicular";
  const auto light = scene.add({"light", glm::dvec3(reflectance), glm::dvec3(emission_nits)});
  const auto grey = scene.add({"grey", glm::dvec3(reflectance), glm::dvec3(0.0)});
  Object floor{"floor", {}, {}};
  floor.polygons.push_back({{{0, 0, 0}, {0, 0, depth}, {edge, 0, depth}, {edge, 0, 0}}, grey});
  Object wall{"wall", {}, {}};
  wall.polygons.push_back({{{0, 0, 0}, {edge, 0, 0}, {edge, height, 0}, {0, height, 0}}, light});
  scene.objects = {floor, wall};
  scene.camera = {{edge / 2, height, 2.0 * (depth + height)}, {edge / 2, height / 3, 0.0}, 0.8, 1.0};
  return scene;
}

TestScene tintedBox(double reflectance, glm::dvec3 emission_nits, glm::dvec3 tint) {
  TestScene scene;
  scene.name = "tinted_box";
  const auto light = scene.add({"light", glm::dvec3(reflectance), emission_nits});
  const auto grey = scene.add({"grey", glm::dvec3(reflectance), glm::dvec3(0.0)});
  Material wall{"mirror", glm::dvec3(1.0), glm::dvec3(0.0)}, glass{"glass", tint, glm::dvec3(0.0)};
  wall.metallic = 1.0;
  glass.transmission = 1.0;
  glass.double_sided = true;
  wall.roughness = glass.roughness = 0.0;
  const auto mirror = scene.add(wall);
  constexpr double kWidth = 4.0, kHeight = 1.0, kMiddle = kHeight / 2;
  Object floor{"floor", {}, {}}, ceiling{"ceiling", {}, {}}, walls{"walls", {}, {}}, pane{"pane", {}, {}};
  const glm::dvec3 low(0.0), high(kWidth, kHeight, kWidth);
  appendBox(floor, low, high, allFaces(light), ~unsigned{kYMin}, true);
  appendBox(ceiling, low, high, allFaces(grey), ~unsigned{kYMax}, true);
  appendBox(walls, low, high, allFaces(mirror), kYMin | kYMax, true);
  pane.polygons.push_back(
      {{{0, kMiddle, 0}, {0, kMiddle, kWidth}, {kWidth, kMiddle, kWidth}, {kWidth, kMiddle, 0}}, scene.add(glass)});
  scene.objects = {std::move(floor), std::move(ceiling), std::move(walls), std::move(pane)};
  scene.camera = {{3.6, 0.9, 3.6}, {1.0, 0.2, 1.0}, 1.2, 1.0};
  return scene;
}

TestScene concentricSpheres(const SphereSpec& inner, const SphereSpec& outer, unsigned subdivisions) {
  TestScene scene;
  scene.name = "sphere_in_sphere";
  const auto inner_material = scene.add({"inner", glm::dvec3(inner.reflectance), glm::dvec3(inner.emission_nits)});
  const auto outer_material = scene.add({"outer", glm::dvec3(outer.reflectance), glm::dvec3(outer.emission_nits)});
  Object ball{"inner", {}, {}};
  appendSphere(ball, glm::dvec3(0.0), inner.radius_m, subdivisions, inner_material, false);
  Object shell{"outer", {}, {}};
  appendSphere(shell, glm::dvec3(0.0), outer.radius_m, subdivisions, outer_material, true);
  scene.objects = {std::move(ball), std::move(shell)};
  scene.camera = {{0.0, 0.0, 0.9 * outer.radius_m}, glm::dvec3(0.0), 1.2, 1.0};
  return scene;
}

}  // namespace radiosity::test_scenes
