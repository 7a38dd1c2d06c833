// Scenes built by hand for the tests of charts, shading and pages.
#pragma once

#include <cmath>
#include <cstdint>
#include <glm/gtc/matrix_transform.hpp>
#include <map>
#include <utility>

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene::test {

inline void addQuad(Primitive& p, glm::dvec3 a, glm::dvec3 b, glm::dvec3 c, glm::dvec3 d) {
  const auto base = static_cast<std::uint32_t>(p.positions.size());
  for (const auto& corner : {a, b, c, d}) p.positions.push_back(corner);  // GCC 12 misreads insert() at -O2
  p.indices.insert(p.indices.end(), {base, base + 1, base + 2, base, base + 2, base + 3});
}

/// size x size in the plane y = 0, facing up, lower corner at (x, z).
inline Primitive floorQuad(double size, double x = 0.0, double z = 0.0) {
  Primitive p;
  addQuad(p, {x, 0, z}, {x, 0, z + size}, {x + size, 0, z + size}, {x + size, 0, z});
  return p;
}

/// Facing outward, or inward (a room).
inline Primitive box(glm::dvec3 low, glm::dvec3 high, bool inward = false) {
  Primitive p;
  const auto at = [&](int x, int y, int z) {
    return glm::dvec3(x ? high.x : low.x, y ? high.y : low.y, z ? high.z : low.z);
  };
  const auto face = [&](glm::dvec3 a, glm::dvec3 b, glm::dvec3 c, glm::dvec3 d) {
    inward ? addQuad(p, a, d, c, b) : addQuad(p, a, b, c, d);
  };
  face(at(0, 0, 0), at(1, 0, 0), at(1, 0, 1), at(0, 0, 1));  // bottom
  face(at(0, 1, 0), at(0, 1, 1), at(1, 1, 1), at(1, 1, 0));  // top
  face(at(0, 0, 0), at(0, 1, 0), at(1, 1, 0), at(1, 0, 0));  // back
  face(at(0, 0, 1), at(1, 0, 1), at(1, 1, 1), at(0, 1, 1));  // front
  face(at(0, 0, 0), at(0, 0, 1), at(0, 1, 1), at(0, 1, 0));  // left
  face(at(1, 0, 0), at(1, 1, 0), at(1, 1, 1), at(1, 0, 1));  // right
  return p;
}

inline Primitive uvSphere(double radius, int slices, int stacks) {
  Primitive p;
  for (int j = 0; j <= stacks; ++j)
    for (int i = 0; i <= slices; ++i) {
      const double theta = M_PI * j / stacks, phi = 2.0 * M_PI * i / slices;
      p.positions.emplace_back(radius * std::sin(theta) * std::cos(phi), radius * std::cos(theta),
                               radius * std::sin(theta) * std::sin(phi));
    }
  const auto id = [&](int i, int j) { return static_cast<std::uint32_t>(j * (slices + 1) + i); };
  for (int j = 0; j < stacks; ++j)
    for (int i = 0; i < slices; ++i) {
      p.indices.insert(p.indices.end(), {id(i, j), id(i + 1, j), id(i + 1, j + 1)});
      p.indices.insert(p.indices.end(), {id(i, j), id(i + 1, j + 1), id(i, j + 1)});
    }
  return p;
}

inline Primitive icoSphere(double radius, int levels) {
  Primitive p;
  const double t = (1.0 + std::sqrt(5.0)) / 2.0;
  for (const auto& v : {glm::dvec3(-1, t, 0),
                        {1, t, 0},
                        {-1, -t, 0},
                        {1, -t, 0},
                        {0, -1, t},
                        {0, 1, t},
                        {0, -1, -t},
                        {0, 1, -t},
                        {t, 0, -1},
                        {t, 0, 1},
                        {-t, 0, -1},
                        {-t, 0, 1}})
    p.positions.push_back(glm::normalize(v) * radius);
  p.indices = {0, 11, 5, 0, 5, 1, 0, 1, 7, 0, 7, 10, 0, 10, 11, 1, 5, 9, 5, 11, 4,  11, 10, 2,  10, 7, 6, 7, 1, 8,
               3, 9,  4, 3, 4, 2, 3, 2, 6, 3, 6, 8,  3, 8,  9,  4, 9, 5, 2, 4,  11, 6,  2,  10, 8,  6, 7, 9, 8, 1};
  for (int level = 0; level < levels; ++level) {
    std::map<std::pair<std::uint32_t, std::uint32_t>, std::uint32_t> middles;
    const auto middle = [&](std::uint32_t a, std::uint32_t b) {
      auto [slot, fresh] = middles.try_emplace(std::minmax(a, b), static_cast<std::uint32_t>(p.positions.size()));
      if (fresh) p.positions.push_back(glm::normalize(p.positions[a] + p.positions[b]) * radius);
      return slot->second;
    };
    std::vector<std::uint32_t> finer;
    for (std::size_t i = 0; i < p.indices.size(); i += 3) {
      const std::uint32_t a = p.indices[i], b = p.indices[i + 1], c = p.indices[i + 2];
      const std::uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
      finer.insert(finer.end(), {a, ab, ca, b, bc, ab, c, ca, bc, ab, bc, ca});
    }
    p.indices = std::move(finer);
  }
  return p;
}

/// Open tube around y.
inline Primitive tube(double radius, double height, int slices) {
  Primitive p;
  for (int i = 0; i < slices; ++i) {
    const double phi = 2.0 * M_PI * i / slices;
    p.positions.emplace_back(radius * std::cos(phi), 0.0, radius * std::sin(phi));
    p.positions.emplace_back(radius * std::cos(phi), height, radius * std::sin(phi));
  }
  for (int i = 0; i < slices; ++i) {
    const auto a = static_cast<std::uint32_t>(2 * i), b = static_cast<std::uint32_t>(2 * ((i + 1) % slices));
    p.indices.insert(p.indices.end(), {a, a + 1, b + 1, a, b + 1, b});
  }
  return p;
}

/// Adds the primitive as its own mesh, material and node.
inline std::uint32_t place(Scene& scene, Primitive p, glm::dmat4 world = glm::dmat4(1.0), Material material = {}) {
  p.mesh = static_cast<std::uint32_t>(scene.primitives.size());
  p.primitive = 0;
  p.material = static_cast<std::uint32_t>(scene.materials.size());
  scene.materials.push_back(std::move(material));
  Instance instance;
  instance.node = static_cast<std::uint32_t>(scene.instances.size());
  instance.primitive = p.mesh;
  instance.world = world;
  scene.primitives.push_back(std::move(p));
  scene.instances.push_back(instance);
  return static_cast<std::uint32_t>(scene.instances.size() - 1);
}

inline Scene sceneOf(Primitive p) {
  Scene scene;
  place(scene, std::move(p));
  return scene;
}

inline double triangleArea(const Scene& scene) {
  double area = 0.0;
  for (const Instance& instance : scene.instances) {
    const Primitive& p = scene.primitives[instance.primitive];
    for (std::size_t i = 0; i < p.indices.size(); i += 3) {
      std::array<glm::dvec3, 3> v;
      for (std::size_t k = 0; k < 3; ++k)
        v[k] = glm::dvec3(instance.world * glm::dvec4(p.positions[p.indices[i + k]], 1.0));
      area += 0.5 * glm::length(glm::cross(v[1] - v[0], v[2] - v[0]));
    }
  }
  return area;
}

/// World area of the leaves of one side.
inline double leafArea(const PatchScene& patches, const Surface& surface, std::size_t side = 0) {
  double sum = 0.0;
  if (surface.first_node[side] == kNone) return 0.0;
  for (std::uint32_t i = 0; i < surface.width * surface.height; ++i)
    sum += patches.node_area[surface.first_node[side] + i];
  return sum * patches.scale * patches.scale;
}
inline double leafArea(const PatchScene& patches, std::size_t side = 0) {
  double sum = 0.0;
  for (const Surface& surface : patches.surfaces) sum += leafArea(patches, surface, side);
  return sum;
}

inline std::size_t coveredLeaves(const PatchScene& patches) {
  std::size_t count = 0;
  for (const LeafPoint& leaf : patches.leaves) count += leaf.triangle != kNone ? 1 : 0;
  return count;
}

}  // namespace radiosity::scene::test
