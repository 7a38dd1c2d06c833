// The scene as the hemicube shaders read it: vertices, level table, and the ids that mean "nothing" and "a side that
// only absorbs". Belongs to one context and its thread.
#pragma once

#include <cstdint>
#include <memory>

#include "server/gpu/gl/gl_objects.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::gpu {

class GpuScene {
 public:
  [[nodiscard]] static Result<GpuScene> upload(const EglContext& context,
                                               std::shared_ptr<const scene::PatchScene> patches);

  /// Ids that follow the nodes' own, so that all of them index one array.
  [[nodiscard]] std::uint32_t escapedId() const { return static_cast<std::uint32_t>(patches_->nodeCount()); }
  [[nodiscard]] std::uint32_t absorbedId() const { return escapedId() + 1; }
  [[nodiscard]] const scene::PatchScene& patches() const { return *patches_; }
  [[nodiscard]] const std::shared_ptr<const scene::PatchScene>& sharedPatches() const { return patches_; }
  [[nodiscard]] GLuint vertexArray() const { return vertex_array_.name(); }
  void bindLevels() const;
  /// Whether there is anything to see through; if so, programs with kSeeThrough must be used.
  [[nodiscard]] bool seeThrough() const { return !patches_->opacity.empty(); }
  void bindOpacity() const;

 private:
  GpuScene() = default;
  [[nodiscard]] Result<void> uploadOpacity(const EglContext& context);

  std::shared_ptr<const scene::PatchScene> patches_;
  Buffer vertices_, levels_, opacity_grids_, opacity_;
  VertexArray vertex_array_;
};

}  // namespace radiosity::gpu
