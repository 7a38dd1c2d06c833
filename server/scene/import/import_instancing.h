// EXT_mesh_gpu_instancing: one transform an element. Pure; any thread.
#pragma once

#include <glm/gtc/quaternion.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec3.hpp>
#include <string>
#include <vector>

#include "server/scene/document/document.h"
#include "server/scene/document/json_text.h"
#include "server/scene/import/import_model.h"

namespace radiosity::scene {

struct Trs {
  glm::dvec3 translation{0.0};
  glm::dquat rotation{1.0, 0.0, 0.0, 0.0};
  glm::dvec3 scale{1.0};

  [[nodiscard]] glm::dmat4 matrix() const;
};

/// `attributes` of the extension on a checked node; `pointer` is theirs, for errors.
[[nodiscard]] Result<std::vector<Trs>> readInstancing(const Document& document, const tinygltf::Model& model,
                                                      const Json& attributes, const std::string& pointer);

}  // namespace radiosity::scene
