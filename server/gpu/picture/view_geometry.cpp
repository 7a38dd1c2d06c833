#include "server/gpu/picture/view_geometry.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat3x3.hpp>

#include "common/task.h"

namespace radiosity::gpu {
namespace {

/// KHR_texture_transform: scale, rotate, offset.
glm::vec2 transformed(const scene::TextureUse& use, glm::vec2 uv) {
  const float c = std::cos(use.rotation);
  const float s = std::sin(use.rotation);
  const auto scaled = uv * use.scale;
  return glm::vec2(c * scaled.x + s * scaled.y, -s * scaled.x + c * scaled.y) + use.offset;
}

glm::vec2 textureUv(const scene::Primitive& primitive, const scene::TextureUse& use, std::uint32_t vertex) {
  const auto& coordinates = use.texcoord == 0 ? primitive.texcoord0 : primitive.texcoord1;
  return transformed(use, vertex < coordinates.size() ? coordinates[vertex] : glm::vec2(0.0F));
}

/// One side of a triangle of the file.
struct DrawnSide {
  const scene::Primitive* of;
  std::size_t triangle, side;
  const std::array<glm::vec2, 3>& lightmap_uv;
};

void addTriangle(const scene::Scene& scene, const scene::Instance& instance, const DrawnSide& drawn,
                 const glm::dvec3& eye, std::vector<ViewVertex>& into) {
  const auto& primitive = *drawn.of;
  const auto& material = scene.materials[primitive.material];
  std::array<glm::dvec3, 3> position{};
  for (std::size_t c = 0; c < 3; ++c) {
    const auto& local = primitive.positions[primitive.indices[3 * drawn.triangle + c]];
    position[c] = glm::dvec3(instance.world * glm::dvec4(local, 1.0)) - eye;
  }
  const bool reversed = (glm::determinant(glm::dmat3(instance.world)) < 0.0) != (drawn.side == 1);
  auto normal = glm::cross(position[1] - position[0], position[2] - position[0]);
  const double length = glm::length(normal);
  if (length > 0.0) normal *= (reversed ? -1.0 : 1.0) / length;
  const std::array<std::size_t, 3> order{0, reversed ? 2U : 1U, reversed ? 1U : 2U};
  for (const auto c : order) {
    const auto vertex = primitive.indices[3 * drawn.triangle + c];
    const auto color = vertex < primitive.color0.size() ? primitive.color0[vertex] : glm::vec4(1.0F);
    into.push_back({glm::vec3(position[c]), glm::vec3(normal),
                    glm::vec4(glm::vec3(color) * material.base_color, color.a * material.alpha),
                    glm::vec4(textureUv(primitive, material.base_color_texture, vertex),
                              textureUv(primitive, material.emissive_texture, vertex)),
                    glm::vec4(textureUv(primitive, material.metallic_texture, vertex),
                              textureUv(primitive, material.specular_texture, vertex)),
                    drawn.lightmap_uv[c], material.emission});
  }
}

/// By instance, by triangle of its primitive, where faces lie on each other; empty: none of the instance's emits.
std::vector<std::vector<bool>> emittingTriangles(const scene::Scene& scene, const scene::PatchScene& patches) {
  std::vector<std::vector<bool>> emitting(scene.instances.size());
  if (patches.covered.empty()) return emitting;
  for (const auto& surface : patches.surfaces) {
    if (!surface.emits) continue;
    auto& triangles = emitting[surface.instance];
    triangles.resize(patches.cuts.primitiveOf(scene, surface.instance).indices.size() / 3, false);
    for (auto t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t)
      triangles[patches.triangle_source[t]] = true;
  }
  return emitting;
}

}  // namespace

glm::dvec2 halfView(const scene::Camera& camera, int width, int height) {
  const double aspect = static_cast<double>(width) / height;
  double half_height = std::tan(camera.yfov_rad / 2.0);
  if (camera.aspect > 0.0 && aspect < camera.aspect) half_height *= camera.aspect / aspect;
  return {half_height * aspect, half_height};
}

ViewGeometry makeViewGeometry(const scene::Scene& scene, const scene::PatchScene& patches, const glm::dvec3& eye) {
  ViewGeometry geometry;
  const auto emitting = emittingTriangles(scene, patches);
  for (std::size_t i = 0; i < scene.instances.size() && i < patches.instance_uvs.size(); ++i) {
    const auto& instance = scene.instances[i];
    if (!instance.visible) continue;
    const auto& primitive = patches.cuts.primitiveOf(scene, static_cast<std::uint32_t>(i));
    for (std::size_t side = 0; side < 2; ++side) {
      const auto& uvs = patches.instance_uvs[i].side[side];
      for (std::size_t triangle = 0; triangle < uvs.page.size(); ++triangle) {
        interruptionPoint();
        if (!uvs.shows(triangle)) continue;  // dropped as degenerate, or nobody sees that side
        const auto page = uvs.page[triangle];
        const bool emits = !emitting[i].empty() && emitting[i][triangle];
        if (geometry.draws.empty() || geometry.draws.back().material != primitive.material ||
            geometry.draws.back().page != page || geometry.draws.back().emits != emits) {
          geometry.draws.push_back(
              {primitive.material, page, static_cast<std::uint32_t>(geometry.vertices.size()), 0, emits});
        }
        addTriangle(scene, instance, {&primitive, triangle, side, uvs.corners[triangle]}, eye, geometry.vertices);
        geometry.draws.back().count += 3;
      }
    }
  }
  // What is drawn first stays where two are equally near: lamps, where faces lie on each other.
  if (!patches.covered.empty())
    std::stable_partition(geometry.draws.begin(), geometry.draws.end(), [](const auto& draw) { return draw.emits; });
  return geometry;
}

}  // namespace radiosity::gpu
