// What two scenes have in common, one being an edit of the other: which instances, charts and leaves are still the
// same, and where something changed. So that an edit of geometry leaves everything else as it is. Plain values, any
// thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// By which a chart is known again beside others that are cut otherwise: the file's triangle that its first is a part
/// of, and how many it has.
struct ChartKey {
  std::uint32_t source, count;
  auto operator<=>(const ChartKey&) const = default;
};
struct InstanceCharts {
  std::vector<ChartKey> keys;  ///< in their order
  bool cut = false;            ///< some of them are, along walls
};
/// By chart of an instance: the one before, or kNone. Of what is whole they have the same order, if they are as many.
[[nodiscard]] std::vector<std::uint32_t> matchCharts(const InstanceCharts& before, const InstanceCharts& after);

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
