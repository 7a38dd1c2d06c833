#include "tests/scenes/scene.h"

#include <glm/geometric.hpp>
#include <utility>

namespace radiosity::test_scenes {

std::uint32_t TestScene::add(Material material) {
  materials.push_back(std::move(material));
  return static_cast<std::uint32_t>(materials.size() - 1);
}

std::size_t TestScene::polygonCount() const {
  std::size_t count = 0;
  for (const auto& object : objects) count += object.polygons.size();
  return count;
}

glm::dvec3 polygonNormal(const Polygon& polygon) {
  glm::dvec3 sum(0.0);
  const auto& corners = polygon.corners;
  for (std::size_t i = 1; i + 1 < corners.size(); ++i) {
    sum += glm::cross(corners[i] - corners[0], corners[i + 1] - corners[0]);
  }
  return sum;
}

double polygonArea(const Polygon& polygon) { return 0.5 * glm::length(polygonNormal(polygon)); }

}  // namespace radiosity::test_scenes
