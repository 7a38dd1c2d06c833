// What the tests of burial and of surfaces on each other ask of a scene that was built.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <optional>
#include <utility>

#include "server/scene/charts/build.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene::test {

inline PatchScene build(const Scene& scene, std::uint64_t budget) {
  ChartOptions options;
  options.texel_budget = budget;
  auto patches = buildPatchScene(scene, options);
  if (!patches) ADD_FAILURE() << patches.error().text();
  return patches ? std::move(*patches) : PatchScene{};
}

/// Of the leaves' fronts (0) or backs (1), of all instances or of one, m^2.
inline double areaOf(const PatchScene& patches, std::size_t side, std::optional<std::uint32_t> instance = {}) {
  double sum = 0.0;
  for (const Surface& surface : patches.surfaces) {
    const auto first = surface.first_node[side];
    if (first == kNone || surface.instance != instance.value_or(surface.instance)) continue;
    for (std::uint32_t i = 0; i < surface.width * surface.height; ++i)
      sum += static_cast<double>(patches.node_area[first + i]);
  }
  return sum * patches.scale * patches.scale;
}

}  // namespace radiosity::scene::test
