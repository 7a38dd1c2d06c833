// A closed room with a lamp on its ceiling and a block on its floor: the smallest scene where moving a thing, or
// switching it off, changes shadows.
#pragma once

#include "tests/scenes/scene.h"
#include "tests/scenes/shapes.h"

namespace radiosity::test {

/// Nodes room, lamp, block (0 to 2); materials wall, light, red (0 to 2).
inline test_scenes::TestScene blockRoom() {
  using namespace test_scenes;
  TestScene scene;
  scene.name = "block_room";
  const auto wall = scene.add({"wall", glm::dvec3(0.6), glm::dvec3(0.0)});
  const auto light = scene.add({"light", glm::dvec3(0.3), glm::dvec3(10.0)});
  const auto red = scene.add({"red", {0.6, 0.2, 0.1}, glm::dvec3(0.0)});
  Object room{"room", {}, {}};
  appendBox(room, glm::dvec3(0.0), {2.0, 2.0, 2.0}, allFaces(wall), kNoFace, true);
  Object lamp{"lamp", {1.0, 1.8, 1.0}, {}};
  appendBox(lamp, {0.6, 1.8, 0.6}, {1.4, 1.9, 1.4}, {wall, wall, light, wall, wall, wall});
  Object block{"block", {0.6, 0.0, 0.6}, {}};
  appendBox(block, {0.3, 0.0, 0.3}, {0.9, 0.8, 0.9}, allFaces(red), kYMin);
  scene.objects = {room, lamp, block};
  scene.camera = {{1.0, 1.0, 1.9}, {1.0, 0.8, 0.0}, 1.2, 1.0};
  return scene;
}

}  // namespace radiosity::test
