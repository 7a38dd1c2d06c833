// The light of the scene as it was, laid on the charts of the scene as it is, so that an edit of geometry fades into
// its new light instead of starting from black. Pure functions of values; solve thread.
#pragma once

#include <vector>

#include "server/scene/lightmap/lightmap.h"
#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::engine {

/// A scene with its charts, and pages of irradiance for them. Refers to its parts.
struct ShownScene {
  const scene::Scene& scene;
  const scene::PatchScene& patches;
  const std::vector<scene::LightmapPage>& pages;
};

/// Pages of `patches`. A texel takes what the same point of the same triangle of the same node's mesh had before;
/// surfaces that were not there get the mean of all. O(texels).
[[nodiscard]] std::vector<scene::LightmapPage> carryLight(const ShownScene& before, const scene::Scene& scene,
                                                          const scene::PatchScene& patches);

/// How much of the new light to show, the rest being carried light: 0 while `error` (what is stated of the solve, as a
/// fraction) is so large that light is missing, 1 from the target error or 5 % on, smooth in between.
[[nodiscard]] double newLightShare(double error, double target_error);

/// The same where the carried light is that of the same scene on coarser texels, with such an error at the surface: it
/// goes where the new one is as good, not before.
[[nodiscard]] double refinedLightShare(double error, double old_error);

/// shown - part + fresh, nowhere below 0; all of one layout. `part` is a part of what is shown, `fresh` what takes its
/// place.
[[nodiscard]] std::vector<scene::LightmapPage> replacePart(std::vector<scene::LightmapPage> shown,
                                                           const std::vector<scene::LightmapPage>& part,
                                                           const std::vector<scene::LightmapPage>& fresh);

/// share x fresh + (1 - share) x carried; both of one layout.
[[nodiscard]] std::vector<scene::LightmapPage> blendPages(const std::vector<scene::LightmapPage>& carried,
                                                          std::vector<scene::LightmapPage> fresh, double share);

}  // namespace radiosity::engine
