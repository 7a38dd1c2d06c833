// What mirrors and metal show in a picture: one reflection, by rays from the eye, since what is drawn knows of none.
#pragma once

#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/gpu/picture/view_renderer.h"
#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::engine {

/// All that it depends on; nothing in it changes any more.
struct MirrorScene {
  std::shared_ptr<const scene::PatchScene> patches;
  scene::PatchMaterials materials;
  std::vector<glm::vec3> irradiance;  ///< lux, by node of level 0
  scene::Sky sky;

  /// Whether a picture has to show more than is drawn.
  [[nodiscard]] bool hasMirrors() const { return materials.specular.sideCount() > 0; }
};

/// Adds radiance (nits) where the picture shows a mirror: of a rough one the mean of some directions. What mirrors show
/// of other mirrors is black. O(n log n) in triangles, and a few rays a pixel, on all cores, with interruption points.
void addMirrors(gpu::ViewPicture& picture, const scene::Camera& camera, const MirrorScene& scene);

}  // namespace radiosity::engine
