#include "tests/oracle/triangle_scene.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace radiosity::oracle {

namespace {

double toLinear(std::uint8_t value) {
  const double v = value / 255.0;
  return v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
}

}  // namespace

glm::dvec4 Texture::at(const glm::dvec2& uv) const {
  const auto place = [](double t, int size) {
    return std::min(size - 1, static_cast<int>((t - std::floor(t)) * size));
  };
  const auto pixel = static_cast<std::size_t>(place(uv.y, height)) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(place(uv.x, width));
  const auto* p = &rgba[4 * pixel];
  return {toLinear(p[0]), toLinear(p[1]), toLinear(p[2]), p[3] / 255.0};
}

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
        triangle.alpha = material.opacity;
        triangle.see_through = material.opacity < 1.0;
        triangle.double_sided = material.double_sided;
        triangle.node = node;
        triangle.material = polygon.material;
        result.triangles.push_back(triangle);
      }
    }
  }
  for (const auto& light : scene.lights) {
    using Kind = test_scenes::Light::Kind;
    Lamp lamp;
    lamp.kind = light.kind == Kind::kPoint  ? Lamp::Kind::kPoint
                : light.kind == Kind::kSpot ? Lamp::Kind::kSpot
                                            : Lamp::Kind::kSun;
    lamp.position = light.position;
    lamp.direction = glm::normalize(light.target - light.position);
    lamp.intensity = light.intensity;
    lamp.range = light.range_m;
    lamp.inner_rad = light.inner_cone_rad;
    lamp.outer_rad = light.outer_cone_rad;
    result.lamps.push_back(lamp);
  }
  result.sky_upper = scene.sky_upper_nits;
  result.sky_lower = scene.sky_lower_nits;
  result.has_sky = scene.sky_upper_nits != glm::dvec3(0.0) || scene.sky_lower_nits != glm::dvec3(0.0);
  return result;
}

}  // namespace radiosity::oracle
