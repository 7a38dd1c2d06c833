// Item buffers of the whole scene in parallel projection: what light from infinity sees. Belongs to one context and its
// thread.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "server/gpu/cull/hemicube_views.h"
#include "server/gpu/cull/parallel_culler.h"
#include "server/gpu/gl/drawing.h"
#include "server/gpu/gl/gl_objects.h"
#include "server/gpu/gl/gpu_scene.h"
#include "server/gpu/gl/image_readback.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

class ParallelRenderer {
 public:
  /// `drawing`: what suits the context, but for tests.
  [[nodiscard]] static Result<ParallelRenderer> create(const EglContext& context,
                                                       std::optional<Drawing> drawing = std::nullopt);

  /// Fails when the driver does not compile the variant for scenes that one can see through.
  [[nodiscard]] Result<void> setScene(const GpuScene& scene);

  /// How many views one render() may take at this resolution.
  [[nodiscard]] std::size_t capacity(std::uint32_t resolution) const;
  [[nodiscard]] ParallelAxes axes(const solver::ParallelView& view, std::uint32_t resolution) const;

  /// resolution^2 items for each view, rows from below; a triangle of the plane seen, or RAD_ITEM_NONE.
  void render(const GpuScene& scene, std::uint32_t resolution, std::span<const solver::ParallelView> views,
              solver::TransportCounters& counters, std::vector<std::uint32_t>& pixels);

 private:
  struct Target {
    Texture ids, depth;
    Framebuffer framebuffer;
  };

  struct DrawCommand {  // as glMultiDrawElementsIndirect reads it
    std::uint32_t count, instance_count, first_index;
    std::int32_t base_vertex;
    std::uint32_t base_instance;
  };

  ParallelRenderer(const EglContext& context, Drawing drawing)
      : context_(&context), drawing_(drawing), readback_(context, drawing) {}
  void placeViews(std::uint32_t resolution, std::span<const solver::ParallelView> views);
  void select(std::uint32_t resolution, std::span<const solver::ParallelView> views,
              solver::TransportCounters& counters);
  Target& target(std::uint32_t resolution, std::size_t views);

  const EglContext* context_;
  Drawing drawing_;
  ImageReadback readback_;
  Program program_;
  std::optional<Program> see_through_;  ///< made for the first scene that needs it
  Buffer indices_buffer_, views_buffer_, commands_buffer_;
  ParallelCuller culler_;
  std::vector<FaceView> faces_;
  std::vector<std::uint32_t> indices_;
  std::vector<DrawCommand> commands_;
  std::size_t index_count_ = 0;  ///< in the buffer for good, where everything is drawn
  glm::vec3 centre_{0.0F};
  float radius_ = 1.0F;
  std::map<std::pair<std::uint32_t, std::size_t>, Target> targets_;  ///< by resolution and layers
};

}  // namespace radiosity::gpu
