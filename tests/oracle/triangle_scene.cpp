#include "tests/oracle/triangle_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <map>
#include <numbers>
#include <tuple>
#include <utility>

namespace radiosity::oracle {

double interfaceOf(double ior) { return std::pow((ior - 1.0) / (ior + 1.0), 2.0); }

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
        triangle.diffuse_transmission = material.diffuse_transmission;
        triangle.transmitted = material.transmitted;
        triangle.emission_lux = std::numbers::pi * material.emission_nits;
        triangle.alpha = material.opacity;
        triangle.see_through = material.opacity < 1.0;
        triangle.double_sided = material.double_sided;
        triangle.transmission = material.transmission;
        triangle.mirror.metallic = material.metallic;
        triangle.mirror.colour = material.reflectance;
        triangle.mirror.roughness = material.roughness;
        triangle.mirror.interface = material.transmission > 0.0 ? interfaceOf(1.5) : 0.0;
        triangle.reflectance *= 1.0 - material.metallic;
        triangle.node = node;
        triangle.material = polygon.material;
        result.triangles.push_back(triangle);
      }
    }
  }
  for (const auto& light : scene.lights) {
    using Kind = test_scenes::Light::Kind;
    Lamp lamp;
    lamp.kind = static_cast<Lamp::Kind>(light.kind);
    lamp.position = light.position;
    lamp.direction = glm::normalize(light.target - light.position);
    lamp.intensity = light.intensity;
    lamp.range = light.range_m;
    lamp.inner_rad = light.inner_cone_rad;
    lamp.outer_rad = light.outer_cone_rad;
    lamp.radius = light.radius_m;
    if (light.kind == Kind::kRectangle) {
      const auto helper = std::abs(lamp.direction.y) < 0.9 ? glm::dvec3(0.0, 1.0, 0.0) : glm::dvec3(1.0, 0.0, 0.0);
      const auto across = glm::normalize(glm::cross(helper, -lamp.direction));
      lamp.half_u = 0.5 * light.width_m * across;
      lamp.half_v = 0.5 * light.height_m * glm::cross(lamp.direction, across);
    }
    result.lamps.push_back(lamp);
  }
  result.sky_upper = scene.sky_upper_nits;
  result.sky_lower = scene.sky_lower_nits;
  result.has_sky = scene.sky_upper_nits != glm::dvec3(0.0) || scene.sky_lower_nits != glm::dvec3(0.0);
  return result;
}

namespace {

using Position = std::tuple<double, double, double>;

/// Corners from the smallest on, in the triangle's own sense of turning or against it.
std::array<Position, 3> cycle(const Triangle& triangle, bool flipped) {
  std::array<Position, 3> corners;
  for (std::size_t k = 0; k < 3; ++k) {
    const auto& p = triangle.corners[flipped ? 2 - k : k];
    corners[k] = {p.x, p.y, p.z};
  }
  std::rotate(corners.begin(), std::min_element(corners.begin(), corners.end()), corners.end());
  return corners;
}

bool sameMaterial(const Triangle& a, const Triangle& b) {
  return a.reflectance == b.reflectance && a.emission_lux == b.emission_lux && a.metallic == b.metallic &&
         a.specular == b.specular && a.base_colour.texture == b.base_colour.texture &&
         a.emissive.texture == b.emissive.texture && a.metal.texture == b.metal.texture &&
         a.specular_texture.texture == b.specular_texture.texture && a.see_through == b.see_through &&
         a.alpha == b.alpha && a.cutoff == b.cutoff && a.transmission == b.transmission &&
         a.passing.texture == b.passing.texture && a.mirror.colour == b.mirror.colour &&
         a.mirror.attenuation == b.mirror.attenuation && a.mirror.metallic == b.mirror.metallic &&
         a.mirror.interface == b.mirror.interface && a.mirror.roughness == b.mirror.roughness &&
         a.diffuse_transmission == b.diffuse_transmission && a.transmitted == b.transmitted &&
         a.transmission_part.texture == b.transmission_part.texture &&
         a.transmission_colour.texture == b.transmission_colour.texture;
}

}  // namespace

TriangleScene joinSides(const TriangleScene& scene) {
  auto joined = scene;
  std::multimap<std::array<Position, 3>, std::size_t> fronts;
  std::vector<bool> gone(scene.triangles.size(), false);
  for (std::size_t t = 0; t < scene.triangles.size(); ++t) {
    const auto& triangle = scene.triangles[t];
    if (triangle.double_sided) continue;
    const auto [begin, end] = fronts.equal_range(cycle(triangle, true));
    const auto twin = std::find_if(
        begin, end, [&](const auto& front) { return sameMaterial(scene.triangles[front.second], triangle); });
    if (twin == end) {
      fronts.emplace(cycle(triangle, false), t);
      continue;
    }
    joined.triangles[twin->second].double_sided = true;
    gone[t] = true;
    fronts.erase(twin);
  }
  std::size_t kept = 0;
  for (std::size_t t = 0; t < gone.size(); ++t) {
    if (!gone[t]) joined.triangles[kept++] = joined.triangles[t];
  }
  joined.triangles.resize(kept);
  return joined;
}

std::vector<std::uint32_t> flippedTwins(const std::vector<Triangle>& triangles) {
  std::map<std::array<Position, 3>, std::uint32_t> places;
  for (std::uint32_t t = 0; t < triangles.size(); ++t) {
    if (!triangles[t].double_sided) places.emplace(cycle(triangles[t], false), t);
  }
  std::vector<std::uint32_t> twins;
  for (const auto& triangle : triangles) {
    const auto found = triangle.double_sided ? places.end() : places.find(cycle(triangle, true));
    twins.push_back(found == places.end() ? kNoTriangle : found->second);
  }
  return twins;
}

std::vector<std::uint32_t> matchTriangles(const TriangleScene& of, const TriangleScene& in) {
  std::map<std::array<Position, 3>, std::vector<std::uint32_t>> places;
  for (std::uint32_t t = 0; t < in.triangles.size(); ++t) {
    places[cycle(in.triangles[t], false)].push_back(t);
    if (in.triangles[t].double_sided) places[cycle(in.triangles[t], true)].push_back(t);
  }
  std::map<std::array<Position, 3>, std::size_t> used;
  std::vector<std::uint32_t> matches;
  for (const auto& triangle : of.triangles) {
    const auto key = cycle(triangle, false);
    const auto found = places.find(key);
    const auto index = used[key]++;
    const bool known = found != places.end() && index < found->second.size();
    matches.push_back(known ? found->second[index] : kNoTriangle);
  }
  return matches;
}

}  // namespace radiosity::oracle
