// Where a ray goes on from mirrors, metal and glass, and what is left of the light that comes from there. Pure
// functions of immutable parts; any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>

#include "server/solver/math/microfacets.h"
#include "server/solver/math/sampling.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/rays/specular_leaves.h"
#include "server/solver/surface/tinted_rays.h"

namespace radiosity::solver {

/// What a ray met that travelled along `direction`.
struct RayEnd {
  std::uint32_t value = LeafRays::kNothing;
  LeafRays::Place end;
  glm::dvec3 direction{0.0};
  std::uint64_t key = 0;
};

/// A mirror that reflected a ray.
struct MirrorHop {
  std::uint32_t mirror = 0;  ///< leaf value
  std::size_t number = 0;    ///< of those on its way, from 0
  std::size_t bounces = 1;   ///< between microfacets of it
};

/// Follows a ray from mirror to mirror, over SpecularLeaves::kMostHops at most: after each calls
/// see(RayEnd, part, MirrorHop), where `part` is what is left of the light that comes from that end, by channel.
/// `mirrors` may be null.
template <typename See>
void followMirrors(const TintedRays& rays, const SpecularLeaves* mirrors, RayEnd at, const See& see) {
  glm::dvec3 part(1.0);
  const auto isMirror = [&] {
    return mirrors != nullptr && !LeafRays::isSky(at.value) && at.value != LeafRays::kNothing && mirrors->has(at.value);
  };
  for (std::size_t hop = 0; hop < SpecularLeaves::kMostHops && isMirror(); ++hop) {
    at.key = mixKeys(at.key, 7 + hop);
    const auto mirror = at.value;
    const auto reflection = reflectByMicrofacets(at.end.normal, at.direction, mirrors->roughness(mirror), at.key);
    for (const double edge : reflection.edges())
      part *= glm::dvec3(mirrors->reflectance(mirror, static_cast<float>(edge)));
    at.direction = reflection.direction;
    const auto from = at.end;
    at.value = rays.see(from, at.direction, at.key, at.end, part);
    see(at, part, MirrorHop{mirror, hop, reflection.count});
  }
}

}  // namespace radiosity::solver
