#include "server/gpu/draw/parallel_renderer.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <glm/geometric.hpp>

#include "common/check.h"

namespace radiosity::gpu {
namespace {

/// Pixels of one image array: as for hemicubes, small where the processor draws and large with a card.
constexpr std::size_t kSoftwarePixels = std::size_t{1} << 16U;
constexpr std::size_t kCardPixels = std::size_t{1} << 22U;
constexpr std::size_t kMaxParallelLayers = 64;

}  // namespace

Result<ParallelRenderer> ParallelRenderer::create(const EglContext& context, std::optional<Drawing> drawing) {
  ParallelRenderer renderer(context, drawing.value_or(drawingOf(context)));
  auto program = buildProgram(context, "hemicube.vert", "hemicube_items.frag", {"PARALLEL"});
  if (!program) return tl::unexpected(program.error());
  renderer.program_ = std::move(*program);
  renderer.indices_buffer_ = Buffer(context, "triangles of parallel views");
  renderer.commands_buffer_ = Buffer(context, "draw commands of parallel views");
  renderer.views_buffer_ = Buffer(context, "parallel views");
  return renderer;
}

Result<void> ParallelRenderer::setScene(const GpuScene& scene) {
  if (scene.seeThrough() && !see_through_) {
    auto program = buildProgram(*context_, "hemicube.vert", "hemicube_items.frag", {"PARALLEL", kSeeThrough});
    if (!program) return tl::unexpected(program.error());
    see_through_ = std::move(*program);
  }
  if (drawing_ == Drawing::kByProcessor) {
    culler_ = ParallelCuller(scene.patches());
  } else {
    const std::span<const std::uint32_t> all(scene.patches().indices);
    fill(indices_buffer_, all, GL_STATIC_DRAW);
    index_count_ = all.size();
  }
  const auto box = solver::sceneBox(scene.patches());
  centre_ = 0.5F * (box[0] + box[1]);
  radius_ = std::max(0.5F * glm::length(box[1] - box[0]), 1.0e-6F);
  return {};
}

std::size_t ParallelRenderer::capacity(std::uint32_t resolution) const {
  const auto pixels = std::size_t{resolution} * resolution;
  if (drawing_ == Drawing::kByProcessor)
    return std::clamp<std::size_t>(kSoftwarePixels / pixels, 1, kMaxParallelLayers);
  const auto triangles = std::max<std::size_t>(index_count_ / 3, 1);
  return std::clamp<std::size_t>(std::min(kCardPixels / pixels, kCardTriangles / triangles), 1, kMaxParallelLayers);
}

ParallelAxes ParallelRenderer::axes(const solver::ParallelView& view, std::uint32_t resolution) const {
  // The scene's sphere fits with a pixel to spare on either side, so that the shift leaves nothing out.
  const auto n = static_cast<float>(resolution);
  const float scale = (n - 2.0F) / (2.0F * radius_);
  const auto up = glm::cross(view.direction, view.right);
  const double side = 1.0 / static_cast<double>(scale);
  return {centre_, scale * view.right, scale * up, glm::vec2(0.5F * n - 0.5F) + view.shift, side * side};
}

/// As of HemicubeRenderer.
ParallelRenderer::Target& ParallelRenderer::target(std::uint32_t resolution, std::size_t views) {
  const std::size_t wanted = drawing_ == Drawing::kByProcessor ? capacity(resolution) : std::bit_ceil(views);
  const std::pair key{resolution, wanted};
  const auto found = targets_.find(key);
  if (found != targets_.end()) return found->second;
  const auto size = static_cast<GLsizei>(resolution);
  const auto layers = static_cast<GLsizei>(wanted);
  Target made{Texture(*context_, "parallel ids", GL_TEXTURE_2D_ARRAY),
              Texture(*context_, "parallel depth", GL_TEXTURE_2D_ARRAY), Framebuffer(*context_, "parallel")};
  glTextureStorage3D(made.ids.name(), 1, GL_R32UI, size, size, layers);
  glTextureStorage3D(made.depth.name(), 1, GL_DEPTH_COMPONENT32F, size, size, layers);
  glNamedFramebufferTexture(made.framebuffer.name(), GL_COLOR_ATTACHMENT0, made.ids.name(), 0);
  glNamedFramebufferTexture(made.framebuffer.name(), GL_DEPTH_ATTACHMENT, made.depth.name(), 0);
  RAD_CHECK_EQ(glCheckNamedFramebufferStatus(made.framebuffer.name(), GL_DRAW_FRAMEBUFFER),
               GLenum{GL_FRAMEBUFFER_COMPLETE});
  return targets_.emplace(key, std::move(made)).first->second;
}

/// How each view looks at the scene.
void ParallelRenderer::placeViews(std::uint32_t resolution, std::span<const solver::ParallelView> views) {
  faces_.clear();
  for (std::uint32_t i = 0; i < views.size(); ++i) {
    const auto a = axes(views[i], resolution);
    const float to_clip = 2.0F / static_cast<float>(resolution);
    const auto shift = to_clip * a.shift - 1.0F;
    faces_.push_back({{to_clip * a.right, shift.x},
                      {to_clip * a.up, shift.y},
                      {views[i].direction / (2.1F * radius_), static_cast<float>(i)},
                      {a.centre, 0.0F}});
  }
  fill(views_buffer_, std::span<const FaceView>(faces_), GL_STREAM_DRAW);
}

/// What each view draws.
void ParallelRenderer::select(std::uint32_t resolution, std::span<const solver::ParallelView> views,
                              solver::TransportCounters& counters) {
  indices_.clear();
  commands_.clear();
  for (std::uint32_t i = 0; i < views.size(); ++i) {
    const auto first = static_cast<std::uint32_t>(indices_.size());
    culler_.select(axes(views[i], resolution), views[i].direction, indices_);
    const auto count = static_cast<std::uint32_t>(indices_.size()) - first;
    if (count > 0) commands_.push_back({count, 1, first, 0, i});
    counters.triangles_drawn += count / 3;
    counters.triangles_culled += culler_.triangleCount() - count / 3;
  }
  fill(indices_buffer_, std::span<const std::uint32_t>(indices_), GL_STREAM_DRAW);
  fill(commands_buffer_, std::span<const DrawCommand>(commands_), GL_STREAM_DRAW);
}

void ParallelRenderer::render(const GpuScene& scene, std::uint32_t resolution,
                              std::span<const solver::ParallelView> views, solver::TransportCounters& counters,
                              std::vector<std::uint32_t>& pixels) {
  RAD_CHECK_LE(views.size(), capacity(resolution));
  const auto start = std::chrono::steady_clock::now();
  context_->makeCurrent();
  auto& into = target(resolution, views.size());
  const bool selects = drawing_ == Drawing::kByProcessor;
  if (selects) select(resolution, views, counters);
  placeViews(resolution, views);
  glViewport(0, 0, static_cast<GLsizei>(resolution), static_cast<GLsizei>(resolution));
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  glEnable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glDisable(GL_BLEND);
  glDisable(GL_MULTISAMPLE);
  glDepthFunc(GL_GREATER);
  glDepthMask(GL_TRUE);
  glBindFramebuffer(GL_FRAMEBUFFER, into.framebuffer.name());
  glUseProgram(scene.seeThrough() ? see_through_->name() : program_.name());
  if (scene.seeThrough()) scene.bindOpacity();
  glBindVertexArray(scene.vertexArray());
  glVertexArrayVertexBuffer(scene.vertexArray(), 1, views_buffer_.name(), 0, sizeof(FaceView));
  glVertexArrayElementBuffer(scene.vertexArray(), indices_buffer_.name());
  const GLuint background = RAD_ITEM_NONE;
  const float far_depth = 0.0F;
  glClearNamedFramebufferuiv(into.framebuffer.name(), GL_COLOR, 0, &background);
  glClearNamedFramebufferfv(into.framebuffer.name(), GL_DEPTH, 0, &far_depth);
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, commands_buffer_.name());
  if (selects && !commands_.empty())
    glMultiDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT, nullptr, static_cast<GLsizei>(commands_.size()), 0);
  if (!selects && index_count_ > 0) {
    glDrawElementsInstanced(GL_TRIANGLES, static_cast<GLsizei>(index_count_), GL_UNSIGNED_INT, nullptr,
                            static_cast<GLsizei>(views.size()));
    counters.triangles_drawn += views.size() * (index_count_ / 3);
  }
  readback_.read(into.ids, resolution, resolution, views.size(), pixels);
  counters.pixels += pixels.size();
  counters.render_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace radiosity::gpu
