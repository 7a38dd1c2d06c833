// Which camera a picture is taken from when nobody placed one, and how bright it is shown. Pure functions of values;
// any thread.
#pragma once

#include <optional>
#include <span>
#include <string>

#include "common/image.h"
#include "common/result.h"
#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::engine {

/// The camera of that name or index; empty: the scene's first camera, nothing where it has none: frameScene() finds
/// one. kNotFound: no camera of that name.
[[nodiscard]] Result<std::optional<scene::Camera>> chooseCamera(const scene::Scene& scene, const std::string& wanted);

/// Tries eyes inside the lit part of the scene (near its corners and sides, looking across) and outside it (the whole
/// scene in view), casts a few hundred rays from each and takes the one that sees most lit surface and most different
/// things, is not close to a wall and does not stand in a solid. Same arguments, same camera. `pages`: irradiance, any
/// unit; all black counts as lit evenly.
[[nodiscard]] scene::Camera frameScene(const scene::Scene& scene, const scene::PatchScene& patches,
                                       std::span<const Image> pages, double aspect);

/// The factor that brings the lit part's logarithmic mean to middle grey (0.18); none when nothing is lit. Pixels far
/// darker or brighter than the rest of the light in the picture (a dark outside, a lamp) do not count.
[[nodiscard]] std::optional<float> exposureOf(const Image& radiance);
/// The same; 1 when nothing is lit.
[[nodiscard]] float autoExposure(const Image& radiance);

}  // namespace radiosity::engine
