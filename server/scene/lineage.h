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

/// An axis-parallel box, unit box coordinates.
struct ChangedBox {
  glm::vec3 low, high;
};

/// Charts keep their identity where they have the same grid on the same instance.
struct PatchMap {
  std::vector<std::uint32_t> surface_before;  ///< by surface: its former number, or kNone: it is new
  std::vector<bool> moved;                    ///< by surface: new, or elsewhere, or of another shape, than it was
  /// By leaf: of a moved surface, or what is left of it, or where one stands on it, is not what it was.
  std::vector<bool> leaf_altered;
  /// Around all that was or is now where something else is or was, one for each instance or fewer.
  std::vector<ChangedBox> boxes;

  [[nodiscard]] bool nothingKept() const;
};

/// Boxes that are hardly larger together than apart become one, and so do all when there are very many.
void joinBoxes(std::vector<ChangedBox>& boxes);

/// `after` was built with `before` as its former self (buildPatchScene), so that both have the same unit box;
/// otherwise is a bug of the caller. O(triangles + leaves).
[[nodiscard]] PatchMap matchPatches(const Scene& scene_before, const PatchScene& before, const Scene& scene_after,
                                    const PatchScene& after);

}  // namespace radiosity::scene
