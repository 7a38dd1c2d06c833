#include "server/gpu/draw/hemicube_renderer.h"

#include <algorithm>
#include <array>
#include <bit>
#include <chrono>
#include <tuple>

#include "common/check.h"

namespace radiosity::gpu {
namespace {

/// Pixels of one atlas. On a CPU it should stay in the second-level cache with its depth; on a GPU a large one hides
/// the latency of the readback.
constexpr std::size_t kSoftwareAtlasPixels = std::size_t{1} << 16U;
constexpr std::size_t kCardAtlasPixels = std::size_t{1} << 22U;
constexpr std::size_t kMaxLayers = 256;
/// Reading the depth of a view takes about as long as drawing so many triangles.
constexpr std::size_t kWorthASecondLook = 256;

void setViewport(std::uint32_t resolution, std::size_t face) {
  const auto n = static_cast<GLsizei>(resolution);
  const auto row = face == 0 ? 0 : n + (static_cast<GLsizei>(face) - 1) * n / 2;
  glViewport(0, row, n, face == 0 ? n : n / 2);
}

void setScissor(const PixelRectangle& around) {
  const auto [first, end] = around;
  glScissor(static_cast<GLint>(first.x), static_cast<GLint>(first.y), static_cast<GLsizei>(end.x - first.x),
            static_cast<GLsizei>(end.y - first.y));
}

}  // namespace

Result<HemicubeRenderer::Programs> HemicubeRenderer::buildPrograms(const EglContext& context, Drawing drawing,
                                                                   std::vector<std::string> defines) {
  if (drawing == Drawing::kByCard) defines.emplace_back("CULL_BELOW");
  const auto build = [&](const char* fragment_shader, const char* define) {
    auto all = defines;
    if (define != nullptr) all.emplace_back(define);
    return buildProgram(context, "hemicube.vert", fragment_shader, all);
  };
  auto nodes = build("hemicube_nodes.frag", "SCATTER");
  if (!nodes) return tl::unexpected(nodes.error());
  auto paper = build("hemicube_paper.frag", "PAPER");
  if (!paper) return tl::unexpected(paper.error());
  auto items = build("hemicube_items.frag", nullptr);
  if (!items) return tl::unexpected(items.error());
  return Programs{std::move(*nodes), std::move(*paper), std::move(*items)};
}

Result<HemicubeRenderer> HemicubeRenderer::create(const EglContext& context, std::optional<Drawing> drawing) {
  HemicubeRenderer renderer(context, drawing.value_or(drawingOf(context)));
  auto programs = buildPrograms(context, renderer.drawing_, {});
  if (!programs) return tl::unexpected(programs.error());
  renderer.opaque_ = std::move(*programs);
  renderer.views_buffer_ = Buffer(context, "hemicube views");
  renderer.indices_buffer_ = Buffer(context, "visible triangles");
  renderer.commands_buffer_ = Buffer(context, "draw commands");
  return renderer;
}

Result<void> HemicubeRenderer::setScene(GpuScene scene, const Culling& culling) {
  if (scene.seeThrough() && !see_through_) {
    auto programs = buildPrograms(*context_, drawing_, {kSeeThrough});
    if (!programs) return tl::unexpected(programs.error());
    see_through_ = std::move(*programs);
  }
  if (drawing_ == Drawing::kByProcessor) {
    culler_ = TriangleCuller(scene.patches(), culling);
  } else {
    const std::span<const std::uint32_t> all(scene.patches().indices);
    fill(indices_buffer_, all, GL_STATIC_DRAW);
    index_count_ = all.size();
  }
  scene_ = std::move(scene);
  paper_ids_.reset();
  return {};
}

Result<void> HemicubeRenderer::preparePaper() {
  if (paper_ids_) return {};
  auto ids = PaperIds::create(scene_->sharedPatches());
  if (!ids) return tl::unexpected(ids.error());
  paper_texture_ = Texture(*context_, "patch ids", GL_TEXTURE_2D);
  const auto name = paper_texture_.name();
  glTextureStorage2D(name, static_cast<GLsizei>(ids->levels()), GL_R32UI, static_cast<GLsizei>(ids->size()),
                     static_cast<GLsizei>(ids->size()));
  for (std::uint32_t level = 0; level < ids->levels(); ++level) {
    const auto width = static_cast<GLsizei>(ids->size() >> level);
    glTextureSubImage2D(name, static_cast<GLint>(level), 0, 0, width, width, GL_RED_INTEGER, GL_UNSIGNED_INT,
                        ids->level(level).data());
  }
  glTextureParameteri(name, GL_TEXTURE_MIN_FILTER, GL_NEAREST_MIPMAP_NEAREST);
  glTextureParameteri(name, GL_TEXTURE_MAG_FILTER, GL_NEAREST);
  glTextureParameteri(name, GL_TEXTURE_WRAP_S, GL_CLAMP_TO_EDGE);
  glTextureParameteri(name, GL_TEXTURE_WRAP_T, GL_CLAMP_TO_EDGE);
  paper_ids_ = std::move(*ids);
  return {};
}

std::size_t HemicubeRenderer::capacity(std::uint32_t resolution) const {
  const auto pixels = hemicubePixels(resolution);
  if (drawing_ == Drawing::kByProcessor) return std::clamp<std::size_t>(kSoftwareAtlasPixels / pixels, 1, kMaxLayers);
  const auto triangles = std::max<std::size_t>(RAD_FACES * index_count_ / 3, 1);
  return std::clamp<std::size_t>(std::min(kCardAtlasPixels / pixels, kCardTriangles / triangles), 1, kMaxLayers);
}

/// A card clears all layers of a target, however few are drawn, and takes long to get large ones: there are several,
/// each twice as large as the one before.
HemicubeRenderer::Target& HemicubeRenderer::target(std::uint32_t resolution, std::size_t views) {
  const std::size_t wanted = drawing_ == Drawing::kByProcessor ? capacity(resolution) : std::bit_ceil(views);
  const std::pair key{resolution, wanted};
  const auto found = targets_.find(key);
  if (found != targets_.end()) return found->second;
  const auto width = static_cast<GLsizei>(resolution);
  const auto height = static_cast<GLsizei>(3 * resolution);
  const auto layers = static_cast<GLsizei>(wanted);
  Target made{Texture(*context_, "hemicube ids", GL_TEXTURE_2D_ARRAY),
              Texture(*context_, "hemicube depth", GL_TEXTURE_2D_ARRAY), Framebuffer(*context_, "hemicubes")};
  glTextureStorage3D(made.ids.name(), 1, GL_R32UI, width, height, layers);
  glTextureStorage3D(made.depth.name(), 1, GL_DEPTH_COMPONENT32F, width, height, layers);
  glNamedFramebufferTexture(made.framebuffer.name(), GL_COLOR_ATTACHMENT0, made.ids.name(), 0);
  glNamedFramebufferTexture(made.framebuffer.name(), GL_DEPTH_ATTACHMENT, made.depth.name(), 0);
  RAD_CHECK_EQ(glCheckNamedFramebufferStatus(made.framebuffer.name(), GL_DRAW_FRAMEBUFFER),
               GLenum{GL_FRAMEBUFFER_COMPLETE});
  return targets_.emplace(key, std::move(made)).first->second;
}

std::size_t HemicubeRenderer::select(std::uint32_t resolution, std::span<const HemicubeView> views,
                                     solver::TransportCounters& counters) {
  selections_.resize(std::max(selections_.size(), views.size()));
  std::size_t waiting = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    culler_.select(views[i].frame, resolution, selections_[i], views[i].window ? &*views[i].window : nullptr);
    counters.triangles_between += selections_[i].between;
    counters.triangles_culled += RAD_FACES * culler_.triangleCount();
    for (const auto& list : selections_[i].second) waiting += list.count / 3;
    counters.faces += RAD_FACES;
    for (std::size_t l = 0; l < 2 * RAD_FACES; l += 2) {
      const auto& [first, second] = std::tie(selections_[i].first, selections_[i].second);
      const auto count = first[l].count + first[l + 1].count + second[l].count + second[l + 1].count;
      counters.faces_empty += count == 0 ? 1 : 0;
    }
  }
  return waiting;
}

/// Triangles that are drawn were counted as culled. Each face of all views has its own call and viewport: where a
/// shader chooses the viewport llvmpipe takes triangles apart, with an allocation and three vertices for each, which
/// took as long as drawing them.
void HemicubeRenderer::draw(TriangleCuller::Lists TriangleCuller::Selection::*lists, std::uint32_t resolution,
                            std::span<const HemicubeView> of, solver::TransportCounters& counters) {
  const std::size_t views = of.size();
  indices_.clear();
  commands_.clear();
  std::array<std::size_t, RAD_FACES + 1> first{};
  for (std::size_t face = 0; face < RAD_FACES; ++face) {
    for (std::size_t i = 0; i < views; ++i) {
      for (std::size_t l = 2 * face; l < 2 * face + 2; ++l) {
        const auto indices = (selections_[i].*lists)[l].valid();
        if (indices.empty()) continue;
        commands_.push_back({static_cast<std::uint32_t>(indices.size()), 1, static_cast<std::uint32_t>(indices_.size()),
                             0, static_cast<std::uint32_t>(face * views + i)});
        indices_.insert(indices_.end(), indices.begin(), indices.end());
      }
    }
    first[face + 1] = commands_.size();
  }
  if (commands_.empty()) return;
  counters.triangles_drawn += indices_.size() / 3;
  counters.triangles_culled -= indices_.size() / 3;
  fill(indices_buffer_, std::span<const std::uint32_t>(indices_), GL_STREAM_DRAW);
  fill(commands_buffer_, std::span<const DrawCommand>(commands_), GL_STREAM_DRAW);
  const bool is_part = views == 1 && of[0].window;
  if (is_part) glEnable(GL_SCISSOR_TEST);  // large triangles that cross a window would fill the face
  for (std::size_t face = 0; face < RAD_FACES; ++face) {
    const auto count = first[face + 1] - first[face];
    if (count == 0) continue;
    setViewport(resolution, face);
    if (is_part) setScissor(around_window_[face]);
    const auto* from = reinterpret_cast<const void*>(first[face] * sizeof(DrawCommand));
    glMultiDrawElementsIndirect(GL_TRIANGLES, GL_UNSIGNED_INT, from, static_cast<GLsizei>(count), 0);
  }
  if (is_part) glDisable(GL_SCISSOR_TEST);
}

void HemicubeRenderer::drawEverything(std::uint32_t resolution, std::size_t views,
                                      solver::TransportCounters& counters) {
  if (index_count_ == 0) return;
  for (std::size_t face = 0; face < RAD_FACES; ++face) {
    setViewport(resolution, face);
    glDrawElementsInstancedBaseInstance(GL_TRIANGLES, static_cast<GLsizei>(index_count_), GL_UNSIGNED_INT, nullptr,
                                        static_cast<GLsizei>(views), static_cast<GLuint>(face * views));
  }
  counters.faces += RAD_FACES * views;
  counters.triangles_drawn += RAD_FACES * views * (index_count_ / 3);
}

void HemicubeRenderer::takeHidden(std::uint32_t resolution, std::span<const HemicubeView> views, const Target& target,
                                  solver::TransportCounters& counters) {
  const auto pixels = hemicubePixels(resolution);
  depth_.resize(views.size() * pixels);
  glGetTextureSubImage(target.depth.name(), 0, 0, 0, 0, static_cast<GLsizei>(resolution),
                       static_cast<GLsizei>(3 * resolution), static_cast<GLsizei>(views.size()), GL_DEPTH_COMPONENT,
                       GL_FLOAT, static_cast<GLsizei>(depth_.size() * sizeof(float)), depth_.data());
  for (std::size_t i = 0; i < views.size(); ++i) {
    counters.triangles_hidden += culler_.takeHidden(
        views[i].frame, resolution, std::span<const float>(depth_).subspan(i * pixels, pixels), selections_[i]);
  }
}

void HemicubeRenderer::setState(HemicubePass pass, const Target& target) {
  glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
  glEnable(GL_DEPTH_TEST);
  glDisable(GL_CULL_FACE);
  glDisable(GL_BLEND);
  glDisable(GL_MULTISAMPLE);
  glDepthFunc(GL_GREATER);
  glDepthMask(GL_TRUE);
  glBindFramebuffer(GL_FRAMEBUFFER, target.framebuffer.name());
  useProgram(pass);
  glBindVertexArray(scene_->vertexArray());
  glVertexArrayVertexBuffer(scene_->vertexArray(), 1, views_buffer_.name(), 0, sizeof(FaceView));
  glVertexArrayElementBuffer(scene_->vertexArray(), indices_buffer_.name());
  glBindBuffer(GL_DRAW_INDIRECT_BUFFER, commands_buffer_.name());
}

void HemicubeRenderer::useProgram(HemicubePass pass) const {
  const Programs& programs = scene_->seeThrough() ? *see_through_ : opaque_;
  if (scene_->seeThrough()) scene_->bindOpacity();
  if (pass == HemicubePass::kNodes) {
    glUseProgram(programs.nodes.name());
    glProgramUniform1ui(programs.nodes.name(), RAD_UNIFORM_ABSORBED_ID, scene_->absorbedId());
    scene_->bindLevels();
  } else if (pass == HemicubePass::kPaper) {
    const auto name = programs.paper.name();
    glUseProgram(name);
    glProgramUniform1ui(name, RAD_UNIFORM_PATCH_BITS, paper_ids_->patchBits());
    glProgramUniform1f(name, RAD_UNIFORM_TEXEL_TO_UV, 1.0F / static_cast<float>(paper_ids_->size()));
    glBindTextureUnit(0, paper_texture_.name());
  } else {
    glUseProgram(programs.items.name());
  }
}

/// All views of one face after the other, so that one call can draw them.
void HemicubeRenderer::placeFaces(std::uint32_t resolution, std::span<const HemicubeView> views) {
  face_views_.resize(RAD_FACES * views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    const auto faces = faceViews(views[i].frame, resolution, views[i].level_bias, static_cast<std::uint32_t>(i));
    for (std::size_t face = 0; face < RAD_FACES; ++face) face_views_[face * views.size() + i] = faces[face];
  }
  fill(views_buffer_, std::span<const FaceView>(face_views_), GL_STREAM_DRAW);
}

void HemicubeRenderer::drawSelected(std::uint32_t resolution, std::span<const HemicubeView> views, const Target& into,
                                    solver::TransportCounters& counters) {
  const auto waiting = select(resolution, views, counters);
  for (std::size_t face = 0; face < RAD_FACES && views.size() == 1 && views[0].window; ++face)
    around_window_[face] = pixelsAround(*views[0].window, views[0].frame, resolution, face);
  draw(&TriangleCuller::Selection::first, resolution, views, counters);
  if (waiting >= kWorthASecondLook * views.size()) takeHidden(resolution, views, into, counters);
  draw(&TriangleCuller::Selection::second, resolution, views, counters);
}

void HemicubeRenderer::render(HemicubePass pass, std::uint32_t resolution, std::span<const HemicubeView> views,
                              solver::TransportCounters& counters, std::vector<std::uint32_t>& pixels) {
  RAD_CHECK(scene_.has_value());
  RAD_CHECK(pass != HemicubePass::kPaper || paper_ids_.has_value());
  RAD_CHECK_LE(views.size(), capacity(resolution));
  const auto start = std::chrono::steady_clock::now();
  context_->makeCurrent();
  auto& into = target(resolution, views.size());
  placeFaces(resolution, views);
  setState(pass, into);
  const GLuint background = pass == HemicubePass::kNodes ? scene_->escapedId() : RAD_ITEM_NONE;
  const float far_depth = 0.0F;
  glClearNamedFramebufferuiv(into.framebuffer.name(), GL_COLOR, 0, &background);
  glClearNamedFramebufferfv(into.framebuffer.name(), GL_DEPTH, 0, &far_depth);
  if (drawing_ == Drawing::kByProcessor) {
    drawSelected(resolution, views, into, counters);
  } else {
    drawEverything(resolution, views.size(), counters);
  }
  readback_.read(into.ids, resolution, 3 * resolution, views.size(), pixels);
  if (pass == HemicubePass::kPaper) paper_ids_->decode(pixels, scene_->escapedId());
  counters.pixels += pixels.size();
  counters.render_seconds += std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

}  // namespace radiosity::gpu
