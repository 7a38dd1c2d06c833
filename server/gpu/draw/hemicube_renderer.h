// Renders hemicubes: five faces of several shooters into the layers of one image, read back at once. Belongs to one
// context and its thread.
//
// Each shooter has its own layer, with its faces always in the same place, so that its pixels are the same whatever
// else is rendered with it. What a processor draws it first looks through for what can be left out; large scenes in two
// steps, the second without what the first hides (see triangle_culler.h). A card draws all of the scene for many
// shooters in five calls, sooner than a processor could choose.
#pragma once

#include <array>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "server/gpu/cull/triangle_culler.h"
#include "server/gpu/draw/paper_ids.h"
#include "server/gpu/gl/drawing.h"
#include "server/gpu/gl/gl_objects.h"
#include "server/gpu/gl/gpu_scene.h"
#include "server/gpu/gl/image_readback.h"
#include "server/solver/transport/transport.h"

namespace radiosity::gpu {

struct HemicubeView {
  solver::HemicubeFrame frame;
  float level_bias = 0.0F;
  std::optional<ViewWindow> window = std::nullopt;  ///< pixels outside need not be drawn
};

/// What the pixels hold.
enum class HemicubePass {
  kNodes,  ///< patch nodes, level by formula; GpuScene::escapedId where nothing is seen
  kPaper,  ///< the same, level by the hardware's mipmapping (Lum, Ma and Max 2002)
  kItems,  ///< a triangle of the plane seen; RAD_ITEM_NONE where nothing is seen
};

class HemicubeRenderer {
 public:
  /// `drawing`: what suits the context, but for tests.
  [[nodiscard]] static Result<HemicubeRenderer> create(const EglContext& context,
                                                       std::optional<Drawing> drawing = std::nullopt);

  /// Fails when the driver does not compile the variant for scenes that one can see through.
  [[nodiscard]] Result<void> setScene(GpuScene scene, const Culling& culling = {});
  /// Makes the ID texture, once a scene; must come before HemicubePass::kPaper.
  [[nodiscard]] Result<void> preparePaper();
  [[nodiscard]] const GpuScene& scene() const { return *scene_; }

  /// How many views one render() may take at this resolution.
  [[nodiscard]] std::size_t capacity(std::uint32_t resolution) const;

  /// hemicubePixels(resolution) ids for each view, in the layout of hemicube_weights.h.
  void render(HemicubePass pass, std::uint32_t resolution, std::span<const HemicubeView> views,
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

  HemicubeRenderer(const EglContext& context, Drawing drawing)
      : context_(&context), drawing_(drawing), readback_(context, drawing) {}
  Target& target(std::uint32_t resolution, std::size_t views);
  void drawSelected(std::uint32_t resolution, std::span<const HemicubeView> views, const Target& into,
                    solver::TransportCounters& counters);
  void drawEverything(std::uint32_t resolution, std::size_t views, solver::TransportCounters& counters);
  void placeFaces(std::uint32_t resolution, std::span<const HemicubeView> views);
  /// Returns the number of triangles that wait for a second step.
  std::size_t select(std::uint32_t resolution, std::span<const HemicubeView> views,
                     solver::TransportCounters& counters);
  void takeHidden(std::uint32_t resolution, std::span<const HemicubeView> views, const Target& target,
                  solver::TransportCounters& counters);
  void draw(TriangleCuller::Lists TriangleCuller::Selection::*lists, std::uint32_t resolution,
            std::span<const HemicubeView> views, solver::TransportCounters& counters);
  void useProgram(HemicubePass pass) const;
  void setState(HemicubePass pass, const Target& target);

  const EglContext* context_;
  Drawing drawing_;
  ImageReadback readback_;
  std::optional<GpuScene> scene_;
  TriangleCuller culler_;
  struct Programs {
    Program nodes, paper, items;
  };
  [[nodiscard]] static Result<Programs> buildPrograms(const EglContext& context, Drawing drawing,
                                                      std::vector<std::string> defines);
  Programs opaque_;
  std::optional<Programs> see_through_;  ///< made for the first scene that needs them
  std::optional<PaperIds> paper_ids_;
  Texture paper_texture_;
  Buffer views_buffer_, indices_buffer_, commands_buffer_;
  std::size_t index_count_ = 0;  ///< in the buffer for good, where everything is drawn
  std::map<std::pair<std::uint32_t, std::size_t>, Target> targets_;  ///< by resolution and layers
  std::vector<FaceView> face_views_;
  std::array<PixelRectangle, RAD_FACES> around_window_{};  ///< of the one view that is drawn, where it has a window
  std::vector<TriangleCuller::Selection> selections_;      ///< by view
  std::vector<std::uint32_t> indices_;
  std::vector<DrawCommand> commands_;
  std::vector<float> depth_;
};

}  // namespace radiosity::gpu
