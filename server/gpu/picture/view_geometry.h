// The scene as one list of vertices for pictures: instances flattened, each triangle with its lightmap coordinates.
// Pure functions of values.
#pragma once

#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::gpu {

/// As view.vert reads it.
struct ViewVertex {
  glm::vec3 position;  ///< metres, relative to the camera
  glm::vec3 normal;
  glm::vec4 color;
  glm::vec4 uv;        ///< of the base colour's texture, and of the emissive one
  glm::vec4 shine_uv;  ///< of the metallic texture, and of the specular one
  glm::vec2 lightmap_uv;
  glm::vec3 emission;
};

/// Consecutive vertices with one material and one page.
struct ViewDraw {
  std::uint32_t material = 0, page = scene::kNone;
  std::uint32_t first = 0, count = 0;
  bool emits = false;  ///< where faces lie on each other: it is the one that is seen
};

struct ViewGeometry {
  std::vector<ViewVertex> vertices;
  std::vector<ViewDraw> draws;
};

/// Tangents of half the horizontal and the vertical field of view. A picture narrower than the camera's own view keeps
/// the view's width.
[[nodiscard]] glm::dvec2 halfView(const scene::Camera& camera, int width, int height);

/// `eye`: subtracted in double, so that scenes far from the origin keep their precision.
[[nodiscard]] ViewGeometry makeViewGeometry(const scene::Scene& scene, const scene::PatchScene& patches,
                                            const glm::dvec3& eye);

}  // namespace radiosity::gpu
