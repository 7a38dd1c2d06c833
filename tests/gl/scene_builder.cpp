#include "tests/gl/scene_builder.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/scene/burial/solid_finder.h"

namespace radiosity::test {

std::uint32_t SceneBuilder::add(const Quad& quad) {
  const auto index = static_cast<std::uint32_t>(scene_.surfaces.size());
  const auto normal = glm::normalize(glm::cross(quad.u, quad.v));
  scene::Surface surface;
  surface.width = quad.width;
  surface.height = quad.height;
  surface.level_count = scene::levelCount(quad.width, quad.height);
  surface.first_leaf = static_cast<std::uint32_t>(scene_.leaves.size());
  surface.first_triangle = static_cast<std::uint32_t>(scene_.triangles.size());
  surface.triangle_count = 2;
  surface.planar = true;
  const auto far = quad.origin + quad.u + quad.v;
  surface.bounds_min = glm::min(glm::min(quad.origin, far), glm::min(quad.origin + quad.u, quad.origin + quad.v));
  surface.bounds_max = glm::max(glm::max(quad.origin, far), glm::max(quad.origin + quad.u, quad.origin + quad.v));
  const float area = glm::length(glm::cross(quad.u, quad.v));
  const auto texels = static_cast<float>(quad.width * quad.height);
  surface.texel_area = area / texels;
  for (int side = 0; side < (quad.double_sided ? 2 : 1); ++side) {
    surface.first_node[static_cast<std::size_t>(side)] = static_cast<std::uint32_t>(scene_.node_area.size());
    for (std::uint32_t level = 0; level < surface.level_count; ++level) {
      const auto grid = scene::levelGrid(quad.width, quad.height, level);
      for (std::uint32_t y = 0; y < grid.height; ++y) {
        for (std::uint32_t x = 0; x < grid.width; ++x) {
          const auto columns = std::min(quad.width, (x + 1) << level) - (x << level);
          const auto rows = std::min(quad.height, (y + 1) << level) - (y << level);
          scene_.node_area.push_back(surface.texel_area * static_cast<float>(columns * rows));
        }
      }
    }
  }
  const auto du = quad.u / static_cast<float>(quad.width);
  const auto dv = quad.v / static_cast<float>(quad.height);
  for (std::uint32_t y = 0; y < quad.height; ++y) {
    for (std::uint32_t x = 0; x < quad.width; ++x) {
      const bool first = (static_cast<float>(x) + 0.5F) * static_cast<float>(quad.height) >=
                         (static_cast<float>(y) + 0.5F) * static_cast<float>(quad.width);
      scene_.leaves.push_back({glm::vec2(x, y) + 0.5F, surface.first_triangle + (first ? 0U : 1U), true});
    }
  }
  const auto base = static_cast<std::uint32_t>(scene_.vertices.size());
  const glm::vec2 size(quad.width, quad.height);
  for (const auto& [a, b] : {std::pair{0.F, 0.F}, {1.F, 0.F}, {1.F, 1.F}, {0.F, 1.F}}) {
    scene_.vertices.push_back({quad.origin + a * quad.u + b * quad.v, index, glm::vec2(a, b) * size, normal});
  }
  for (const auto corner : {0U, 1U, 2U, 0U, 2U, 3U}) scene_.indices.push_back(base + corner);
  for (int i = 0; i < 2; ++i) {
    scene_.triangles.push_back({quad.origin, du, dv, normal});
    scene_.triangle_surface.push_back(index);
  }
  scene_.surfaces.push_back(surface);
  scene_.polygons += 1;
  return index;
}

std::uint32_t SceneBuilder::addBox(glm::vec3 low, glm::vec3 high, std::uint32_t texels, bool inside) {
  const auto first = static_cast<std::uint32_t>(scene_.surfaces.size());
  const auto size = high - low;
  for (int axis = 0; axis < 3; ++axis) {
    glm::vec3 u(0.0F), v(0.0F), along(0.0F);
    u[(axis + 1) % 3] = size[(axis + 1) % 3];
    v[(axis + 2) % 3] = size[(axis + 2) % 3];
    along[axis] = size[axis];  // u x v points along +axis
    add(inside ? Quad{low, u, v, texels, texels} : Quad{low, v, u, texels, texels});
    add(inside ? Quad{low + along, v, u, texels, texels} : Quad{low + along, u, v, texels, texels});
  }
  return first;
}

std::shared_ptr<const scene::PatchScene> SceneBuilder::build() const {
  auto scene = std::make_shared<scene::PatchScene>(scene_);
  scene->pages = {{64, 64}};
  scene->solids = scene::findClosedSolids(*scene);
  return scene;
}

std::uint32_t SceneBuilder::addBevelledPlate() {
  const float wide = 0.2F, narrow = 0.198F, bottom = -0.2F, rim = -0.197F, top = -0.195F;
  const auto at = [](const glm::vec2& out, float across, float along, float z) {
    return glm::vec3(out * across + glm::vec2(-out.y, out.x) * along, z);
  };
  const std::uint32_t first = add({{-wide, wide, bottom}, {2 * wide, 0, 0}, {0, -2 * wide, 0}, 16, 16, true});
  add({{-narrow, -narrow, top}, {2 * narrow, 0, 0}, {0, 2 * narrow, 0}, 16, 16, true});
  for (const auto& out : {glm::vec2(1, 0), glm::vec2(0, 1), glm::vec2(-1, 0), glm::vec2(0, -1)}) {
    const auto low = at(out, wide, -wide, bottom), ridge = at(out, wide, -wide, rim);
    const auto along = at(out, 0.0F, 2 * wide, 0.0F);
    add({low, along, ridge - low, 16, 1, true});
    // As wide as the plate: it reaches beyond the bevel of the next side, and closes the corner.
    add({ridge, along, at(out, narrow, -wide, top) - ridge, 16, 1, true});
  }
  return first;
}

double shareInside(const scene::PatchScene& scene, const solver::FluxAccumulators& flux, std::uint32_t plate) {
  const glm::vec3 middle(0.0F, 0.0F, -0.1985F);
  double inside = 0.0, outside = 0.0;
  for (auto s = plate; s < plate + 10; ++s) {
    const auto& face = scene.surfaces[s];
    const auto way = middle - 0.5F * (face.bounds_min + face.bounds_max);
    const int inner = glm::dot(scene.triangles[face.first_triangle].normal, way) > 0.0F ? 0 : 1;
    inside += fluxAt(scene, flux, s, kFluxScale, inner);
    outside += fluxAt(scene, flux, s, kFluxScale, 1 - inner);
  }
  return inside / outside;
}

std::shared_ptr<const scene::PatchScene> randomRoom(std::uint32_t quads, std::uint32_t texels, std::uint32_t seed) {
  SceneBuilder builder;
  const auto side = [&](double share) {
    return static_cast<std::uint32_t>(std::max(1.0, std::round(std::sqrt(share * texels))));
  };
  builder.addBox(glm::vec3(-0.5F), glm::vec3(0.5F), side(0.5 / 6), true);
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> unit(0.0F, 1.0F);
  const auto boxes = (quads - 6) / 6;
  for (std::uint32_t i = 0; i < boxes; ++i) {
    const glm::vec3 size(0.02F + 0.06F * unit(random), 0.02F + 0.06F * unit(random), 0.02F + 0.06F * unit(random));
    const glm::vec3 free = glm::vec3(0.98F) - size;
    const auto low = glm::vec3(-0.49F) + free * glm::vec3(unit(random), unit(random), unit(random));
    builder.addBox(low, low + size, side(0.5 / (6.0 * boxes)), false);
  }
  return builder.build();
}

solver::ScatterShot shotFrom(const scene::PatchScene& scene, std::uint32_t surface, float u, float v,
                             std::uint32_t resolution, std::mt19937& random) {
  const auto& chart = scene.surfaces[surface];
  const auto& frame = scene.triangles[chart.first_triangle];
  solver::ScatterShot shot;
  shot.frame.origin =
      frame.origin + u * static_cast<float>(chart.width) * frame.du + v * static_cast<float>(chart.height) * frame.dv;
  shot.frame.normal = frame.normal;
  const auto across = glm::normalize(frame.du);
  const auto up = glm::cross(frame.normal, across);
  const float angle = std::uniform_real_distribution<float>(0.0F, 2.0F * std::numbers::pi_v<float>)(random);
  shot.frame.tangent = std::cos(angle) * across + std::sin(angle) * up;
  shot.frame.lattice = std::uniform_int_distribution<std::uint32_t>(0, 15)(random);
  shot.resolution = resolution;
  shot.level_bias = std::uniform_real_distribution<float>(0.0F, 1.0F)(random);
  shot.flux = {1.0, 0.5, 0.25};
  return shot;
}

solver::FluxAccumulators accumulators(const scene::PatchScene& scene) {
  solver::FluxAccumulators flux;
  for (auto& half : flux.node) half.assign(scene.nodeCount(), solver::Flux3{});
  return flux;
}

double fluxAt(const scene::PatchScene& scene, const solver::FluxAccumulators& flux, std::uint32_t surface,
              double flux_scale, int side) {
  const auto& chart = scene.surfaces[surface];
  const auto last = scene::levelGrid(chart.width, chart.height, chart.level_count - 1);
  const auto first = chart.first_node[static_cast<std::size_t>(side)];
  double sum = 0.0;
  for (const auto& half : flux.node) {
    for (auto id = first; id < first + last.offset + 1; ++id) sum += static_cast<double>(half[id][0]);
  }
  return sum / flux_scale;
}

}  // namespace radiosity::test
