#include "tests/oracle/triangle_scene.h"

#include <glm/geometric.hpp>
#include <numbers>

namespace radiosity::oracle {

double area(const Triangle& triangle) {
  const auto& [a, b, c] = triangle.corners;
  return 0.5 * glm::length(glm::cross(b - a, c - a));
}

TriangleScene triangulate(const test_scenes::TestScene& scene) {
  TriangleScene result;
  for (std::uint32_t node = 0; node < scene.objects.size(); ++node) {
    result.node_names.push_back(scene.objects[node].name);
    for (const auto& polygon : scene.objects[node].polygons) {
      const auto& material = scene.materials[polygon.material];
      for (std::size_t i = 1; i + 1 < polygon.corners.size(); ++i) {
        Triangle triangle;
        triangle.corners = {polygon.corners[0], polygon.corners[i], polygon.corners[i + 1]};
        const auto& [a, b, c] = triangle.corners;
        triangle.normal = glm::normalize(glm::cross(b - a, c - a));
        triangle.reflectance = material.reflectance;
        triangle.emission_lux = std::numbers::pi * material.emission_nits;
        triangle.node = node;
        triangle.material = polygon.material;
        result.triangles.push_back(triangle);
      }
    }
  }
  return result;
}

}  // namespace radiosity::oracle
