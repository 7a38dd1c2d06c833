// The sky around a scene as a picture for viewers, whatever it is made of. Pure functions; any thread.
#pragma once

#include "common/bytes.h"
#include "server/scene/values/scene.h"

namespace radiosity::engine {

/// Radiance HDR, equirectangular, 1024 x 512, in nits: its colours, its picture and its sun, turned and as strong as
/// they are. The middle column is towards +X, those to its right by way of +Z; the top row +Y. Cost: some 50 ms.
[[nodiscard]] Bytes hdrOfSky(const scene::Sky& sky);

}  // namespace radiosity::engine
