#include "tests/accuracy/stress/glass_scenes.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/accuracy/stress/leaves.h"
#include "tests/scenes/scenes.h"
#include "tests/scenes/shapes.h"

namespace radiosity::accuracy {

using test_scenes::Material;
using test_scenes::Object;
using test_scenes::TestScene;

Material glassOf(const glm::dvec3& colour, bool is_double_sided) {
  Material material{"glass", colour, {}};
  material.transmission = 1.0;
  material.roughness = 0.0;
  material.double_sided = is_double_sided;
  return material;
}

double reflectanceAt(double cosine) { return 0.04 + 0.96 * std::pow(1.0 - cosine, 5.0); }

TestScene floorBelow(const std::vector<Material>& panes, bool has_walls) {
  TestScene scene;
  scene.name = "floor_below_glass";
  const auto black = scene.add({"black", glm::dvec3(0.0), {}});
  const auto shines = scene.add({"shines", glm::dvec3(0.0), glm::dvec3(1.0)});
  const auto square = [](double y) {
    return std::vector<glm::dvec3>{{-2.5, y, 2.5}, {2.5, y, 2.5}, {2.5, y, -2.5}, {-2.5, y, -2.5}};
  };
  Object room{"room", {}, {}}, floor{"floor", {}, {}};
  appendBox(room, glm::dvec3(-3.0), glm::dvec3(3.0), test_scenes::allFaces(shines), test_scenes::kNoFace, true);
  floor.polygons = {{square(0.0), black}};
  if (has_walls) scene.objects.push_back(room);
  scene.objects.push_back(floor);
  double height = 0.0;
  for (const auto& pane : panes) {
    Object sheet{"pane", {}, {}};
    sheet.polygons = {{square(height += 0.02), scene.add(pane)}};
    scene.objects.push_back(sheet);
  }
  return scene;
}

glm::dvec3 meanOnFloor(const Solve& solve) {
  glm::dvec3 sum(0.0);
  std::size_t count = 0;
  for (const auto& leaf : wholeLeaves(solve)) {
    if (std::max(std::abs(leaf.middle.x), std::abs(leaf.middle.z)) > 1.5 || std::abs(leaf.middle.y) > 0.01) continue;
    sum += leaf.light;
    ++count;
  }
  EXPECT_GT(count, 50U);
  return sum / static_cast<double>(count);
}

TestScene roomWithBulb(const Material& material) {
  TestScene scene;
  scene.name = "bulb";
  const auto white = scene.add({"white", glm::dvec3(0.7), {}});
  const auto light = scene.add({"light", glm::dvec3(0.0), glm::dvec3(20.0)});
  const auto clear = scene.add(material);
  Object room{"room", {}, {}}, bulb{"bulb", {}, {}}, lamp{"lamp", {}, {}};
  appendBox(room, {0, 0, 0}, {2, 2, 2}, test_scenes::allFaces(white), test_scenes::kNoFace, true);
  appendSphere(bulb, {1.0, 1.2, 1.0}, 0.3, 2, clear, false);
  appendBox(lamp, {0.9, 1.1, 0.9}, {1.1, 1.3, 1.1}, test_scenes::allFaces(light));
  scene.objects = {room, bulb, lamp};
  return scene;
}

}  // namespace radiosity::accuracy
