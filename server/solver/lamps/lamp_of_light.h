// Lights of a scene that have a size or a web, as lamps in the unit box. Pure functions; any thread.
#pragma once

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"
#include "server/solver/transport/lamp_shape.h"

namespace radiosity::solver {

[[nodiscard]] bool hasSizeOrWeb(const scene::PunctualLight& light);

/// Of a rectangle or disc, square metres.
[[nodiscard]] double lampArea(const scene::PunctualLight& light);

/// Of a spot that has a size.
struct Cone {
  float scale = 0.0F, offset = 1.0F;
};
/// Of one that has a size or a web.
[[nodiscard]] LampShape lampShape(const scene::PatchScene& patches, const scene::PunctualLight& light,
                                  const Cone& cone);

}  // namespace radiosity::solver
