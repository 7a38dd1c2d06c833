// What an edit changed, seen from the two scenes as values rather than from their JSON: names, extras, and things that
// nobody places change nothing, and so does appending what will be used later. Pure; solve thread.
#pragma once

#include <cstdint>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::engine {

struct SceneChange {
  /// Shape, place, visibility, sides or see-through parts of a surface: charts and links are no longer true.
  bool geometry = false;
  /// Otherwise: the materials whose emission or reflectance differs (indices into both scenes' materials).
  std::vector<std::uint32_t> materials;
  /// Of these, those whose surfaces may begin or cease to emit: where faces lie on each other, another is seen then.
  std::vector<std::uint32_t> switched;

  [[nodiscard]] bool nothing() const { return !geometry && materials.empty(); }
};

/// Lights without extent and the sky are not looked at: what they deliver is compared by the solver's sources. Cost: a
/// comparison of all vertices and decoded textures.
[[nodiscard]] SceneChange changeBetween(const scene::Scene& before, const scene::Scene& after);

/// Whether another of the faces that lie on each other may be seen where surfaces of these materials begin or cease to
/// emit. Cost: a pass over the leaves, where there are such materials.
[[nodiscard]] bool mayUncover(const scene::PatchScene& patches, const std::vector<std::uint32_t>& switched);

/// Whether nothing but places of nodes, and what materials emit and reflect, differs, so that one who has the file of
/// `before` can bring it up to date by the nodes' transforms alone. Cost: as changeBetween().
[[nodiscard]] bool onlyNodesMoved(const scene::Scene& before, const scene::Scene& after);

}  // namespace radiosity::engine
