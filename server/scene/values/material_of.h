// The material that something is made of; what names none has glTF's default. Pure; any thread.
#pragma once

#include <cstdint>

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// `material`: an index, or kNone.
[[nodiscard]] inline const Material& materialOf(const Scene& scene, std::uint32_t material) {
  static const Material kDefault;
  return material < scene.materials.size() ? scene.materials[material] : kDefault;
}

[[nodiscard]] inline const Material& materialOf(const Scene& scene, const Surface& surface) {
  return materialOf(scene, surface.material);
}

[[nodiscard]] inline const Material& materialOf(const Scene& scene, const Instance& instance) {
  return materialOf(scene, scene.primitives[instance.primitive].material);
}

}  // namespace radiosity::scene
