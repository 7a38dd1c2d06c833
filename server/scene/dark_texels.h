// Texels that a dark room would be lit by: those that lie partly in it, or whose light bilinear lookups in it mix in,
// where walls stand on a surface that goes on beyond them. They are dark: a dark rim in the light is a smaller fault
// than light in a closed room. A step of buildPatchScene (charts.h).
#pragma once

#include <cstdint>
#include <vector>

#include "server/geometry/ray_scene.h"
#include "server/scene/lit_sides.h"
#include "server/scene/patch_scene.h"

namespace radiosity::scene {

struct DarkTexels {
  /// A place of a leaf that lies partly in a dark room: there.
  struct Leaf {
    std::uint32_t leaf;
    LeafPoint point;
  };
  std::vector<PatchScene::DarkTexel> texels;  ///< sorted
  std::vector<Leaf> leaves;                   ///< ascending
};

/// The same for the same geometry and the same lamps, however bright these are. Nothing where no room is dark, which
/// takes some ten milliseconds in a furnished room. `tree`: of the triangles of `patches`.
[[nodiscard]] DarkTexels findDarkTexels(const PatchScene& patches, const Scene& scene, const Sky& sky,
                                        const geometry::RayScene& tree);

/// Keeps them, and has leaves that lie partly in a dark room get their light there: none.
void darkenTexels(PatchScene& patches, const Scene& scene, const Sky& sky);

}  // namespace radiosity::scene
