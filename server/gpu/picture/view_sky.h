// The sky behind a picture. Pure functions of values.
#pragma once

#include "server/gpu/picture/view_renderer.h"
#include "server/scene/values/scene.h"

namespace radiosity::gpu {

/// Adds the sky's radiance to each pixel, as far as no surface covers the pixel. `camera`: the picture's own.
void addSky(ViewPicture& picture, const scene::Camera& camera, const scene::Sky& sky);

/// Of one direction, of unit length; nits.
[[nodiscard]] glm::vec3 skyRadiance(const scene::Sky& sky, const glm::dvec3& direction);

}  // namespace radiosity::gpu
