// Where one can see through surfaces: alphaMode MASK and BLEND, and KHR_materials_transmission, sampled on a grid in
// each surface's chart, finer than its leaves where the textures are. A step of buildPatchScene (charts.h).
#pragma once

#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// Whether a material lets any light through.
[[nodiscard]] bool isSeeThrough(const Material& material);

/// Fills the opacity grids of surfaces one can see through (Surface::see_through): MASK gives the part of a cell above
/// the cutoff, BLEND alpha, transmission what a face does not let pass (specular.h); all of them multiplied, and of
/// coloured glass the channel that passes best, with PatchScene::tints for the others. Grids together have at most 2^26
/// cells: beyond that they are coarser, with a warning. Fills Surface::glass, too. Needs vertices and triangle_source.
void measureOpacity(const Scene& scene, PatchScene& patches);

/// Multiplies the leaf areas of those surfaces by the opacity of the leaf; what is wholly cut out becomes empty.
void applyOpacity(PatchScene& patches);

}  // namespace radiosity::scene
