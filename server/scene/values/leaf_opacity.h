// How much of the light leaves stop that one can see through, by the cells of their opacity grid. Pure functions of
// values; any thread.
#pragma once

#include <cstddef>
#include <cstdint>

#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// Calls visit(cell) for each cell of a leaf, number `leaf` of a surface one can see through.
template <typename Visit>
void forCellsOf(const Surface& surface, std::uint32_t leaf, const Visit& visit) {
  const std::uint32_t scale = surface.opacity_scale, width = surface.width * scale;
  const std::uint32_t x0 = leaf % surface.width * scale, y0 = leaf / surface.width * scale;
  for (std::uint32_t y = y0; y < y0 + scale; ++y) {
    for (std::uint32_t x = x0; x < x0 + scale; ++x) visit(surface.first_opacity + std::size_t{y} * width + x);
  }
}

/// Mean over the cells of a leaf, in [0, 1].
[[nodiscard]] inline float leafOpacity(const PatchScene& patches, const Surface& surface, std::uint32_t leaf) {
  std::uint64_t sum = 0;
  forCellsOf(surface, leaf, [&](std::size_t cell) { sum += patches.opacity[cell]; });
  return static_cast<float>(static_cast<double>(sum) / (255.0 * surface.opacity_scale * surface.opacity_scale));
}

/// Part of the light from all around that a leaf stops; 1 where nothing passes.
[[nodiscard]] inline float stoppedByLeaf(const PatchScene& patches, const Surface& surface, std::uint32_t leaf) {
  if (!surface.see_through) return 1.0F;
  const float opacity = leafOpacity(patches, surface, leaf);
  return surface.glass.isGlass() ? surface.glass.meanStopped(opacity) : opacity;
}

}  // namespace radiosity::scene
