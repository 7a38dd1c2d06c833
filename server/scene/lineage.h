// What two scenes have in common, one being an edit of the other: which instances, charts and leaves are still the
// same, and where something changed. So that an edit of geometry leaves everything else as it is. Plain values, any
// thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/patch_scene.h"
#include "server/scene/scene.h"

namespace radiosity::scene {

/// By instance of `after`: the one of `before` that was placed by the same node with the same mesh and primitive (of
/// several, in their order), or kNone. O(n log n).
[[nodiscard]] std::vector<std::uint32_t> matchInstances(const Scene& before, const Scene& after);

/// By surface of `after`: the one of `before` that has the same triangles in the same places, texels and all, or kNone.
/// Asks for no leaves. O(triangles).
[[nodiscard]] std::vector<std::uint32_t> matchSurfaces(const Scene& scene_before, const PatchScene& before,
                                                       const Scene& scene_after, const PatchScene& after);

/// `after` was built with `before` as its former self (buildPatchScene), so that both have the same unit box;
/// otherwise is a bug of the caller. O(triangles + leaves).
[[nodiscard]] PatchMap matchPatches(const Scene& scene_before, const PatchScene& before, const Scene& scene_after,
                                    const PatchScene& after);

}  // namespace radiosity::scene
