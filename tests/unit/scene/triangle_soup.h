// Triangles of all sizes in all directions.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <random>
#include <vector>

#include "server/geometry/bvh.h"

namespace radiosity::scene::test {

/// Around the middle of the unit box; the same for the same seed.
inline std::vector<Bvh::Triangle> triangleSoup(std::size_t count, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> uniform(-0.5F, 0.5F);
  std::vector<Bvh::Triangle> triangles(count);
  for (auto& t : triangles) {
    const glm::vec3 centre(uniform(random), uniform(random), uniform(random));
    for (auto& p : t) p = centre + 0.2F * glm::vec3(uniform(random), uniform(random), uniform(random));
  }
  return triangles;
}

}  // namespace radiosity::scene::test
