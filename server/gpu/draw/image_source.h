// What draws, and how those who look at images get them: the context's own thread at once, others through a desk.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/gpu/draw/hemicube_renderer.h"
#include "server/gpu/draw/parallel_renderer.h"
#include "server/gpu/draw/render_desk.h"
#include "server/gpu/gl/egl_context.h"

namespace radiosity::gpu {

/// A context and all that lives in it. One thread.
struct Renderers {
  std::unique_ptr<EglContext> context;  ///< outlives what lives in it
  HemicubeRenderer hemicubes;
  ParallelRenderer parallel;

  /// `drawing`: what suits the context, but for tests.
  [[nodiscard]] static Result<std::unique_ptr<Renderers>> create(std::optional<Drawing> drawing = std::nullopt);
  [[nodiscard]] Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches);
};

/// Images for one looker, in memory of its own. One thread: that of the renderers, or one whose orders a desk takes.
class ImageSource {
 public:
  explicit ImageSource(Renderers& renderers, RenderDesk* desk = nullptr) : renderers_(&renderers), desk_(desk) {}

  /// As the renderers' functions of these names; images are valid until the next call.
  [[nodiscard]] std::size_t hemicubeCapacity(std::uint32_t resolution) const;
  [[nodiscard]] std::size_t parallelCapacity(std::uint32_t resolution) const;
  [[nodiscard]] ParallelAxes axes(const solver::ParallelView& view, std::uint32_t resolution) const;
  std::span<const std::uint32_t> hemicubes(HemicubePass pass, std::uint32_t resolution,
                                           std::span<const HemicubeView> views, solver::TransportCounters& counters);
  std::span<const std::uint32_t> parallel(std::uint32_t resolution, std::span<const solver::ParallelView> views,
                                          solver::TransportCounters& counters);
  [[nodiscard]] Result<void> preparePaper();
  /// That its user has spent waiting for images.
  [[nodiscard]] double seconds() const { return seconds_; }
  /// EglContext::check.
  [[nodiscard]] Result<void> check();

 private:
  void ask(const std::function<void()>& work);

  Renderers* renderers_;
  RenderDesk* desk_;
  std::vector<std::uint32_t> pixels_;
  double seconds_ = 0.0;
};

}  // namespace radiosity::gpu
