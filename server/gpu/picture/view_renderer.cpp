#include "server/gpu/picture/view_renderer.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/gtc/matrix_inverse.hpp>
#include <glm/gtc/type_ptr.hpp>
#include <map>

#include "common/check.h"
#include "common/task.h"
#include "server/gpu/gl/gl_objects.h"
#include "server/gpu/picture/view_geometry.h"

namespace radiosity::gpu {
namespace {

constexpr int kMaxPicture = 8192;  ///< pixels a side
constexpr int kSamples = 4;
/// Pixels a side that are drawn at a time: a tile takes a software renderer a few hundredths of a second, and no
/// picture needs a gigabyte of samples. Each tile costs a pass over all vertices, so that tiles of large scenes are
/// larger.
constexpr int kTile = 512, kLargeTile = 1024;
constexpr std::size_t kManyVertices = 200'000;

// Locations in view.vert and view.frag.
enum Uniform : GLint {
  kClipFromView = 0,
  kQuantity = 1,
  kAlphaCutoff = 2,
  kBaseAlpha = 3,
  kDataScale = 4,
  kMetallic = 5,
  kSpecular = 6
};

/// Infinite, reversed depth: 1 at the near plane, 0 far away.
glm::mat4 projection(const scene::Camera& camera, int width, int height) {
  const auto half = halfView(camera, width, height);
  glm::mat4 matrix(0.0F);
  matrix[0][0] = static_cast<float>(1.0 / half.x);
  matrix[1][1] = static_cast<float>(1.0 / half.y);
  matrix[2][3] = -1.0F;
  matrix[3][2] = static_cast<float>(std::max(camera.znear, 1.0e-6));
  return matrix;
}

class GlViewRenderer final : public ViewRenderer {
 public:
  static Result<std::unique_ptr<ViewRenderer>> create() {
    auto context = EglContext::create();
    if (!context) return tl::unexpected(context.error());
    auto program = buildProgram(**context, "view.vert", "view.frag");
    if (!program) return tl::unexpected(program.error());
    return std::unique_ptr<ViewRenderer>(new GlViewRenderer(std::move(*context), std::move(*program)));
  }

  Result<ViewPicture> render(const scene::Scene& scene, const scene::PatchScene& patches, std::span<const Image> pages,
                             const ViewRequest& request) override {
    if (request.width < 1 || request.height < 1 || request.width > kMaxPicture || request.height > kMaxPicture) {
      return fail(ErrorCode::kBadUsage, "a picture is 1 to 8192 pixels wide and high");
    }
    context_->makeCurrent();
    const auto geometry = makeViewGeometry(scene, patches, glm::dvec3(request.camera.world[3]));
    const int side = geometry.vertices.size() > kManyVertices ? kLargeTile : kTile;
    const auto target = makeTarget(std::min(side, request.width), std::min(side, request.height));
    fill(vertices_, std::span<const ViewVertex>(geometry.vertices), GL_STREAM_DRAW);
    const auto lightmaps = uploadPages(pages);
    glProgramUniform1f(program_.name(), kDataScale, dataScale(pages, request.quantity));
    std::map<std::uint32_t, Texture> textures;
    const auto row = static_cast<std::size_t>(request.width);
    ViewPicture picture{Image(request.width, request.height),
                        std::vector<float>(row * static_cast<std::size_t>(request.height))};
    for (int y = 0; y < request.height; y += side) {
      for (int x = 0; x < request.width; x += side) {
        interruptionPoint();
        const Tile tile{x, y, std::min(side, request.width - x), std::min(side, request.height - y)};
        setState(request, tile, target);
        draw(scene, lightmaps, geometry, textures);
        read(tile, target, picture);
        if (const auto good = context_->check(); !good) return tl::unexpected(good.error());
      }
    }
    return picture;
  }

 private:
  /// Pixels of the picture as OpenGL counts them: rows from the bottom.
  struct Tile {
    int x, y, width, height;
  };
  struct Target {
    Texture color, depth, resolved;
    Framebuffer framebuffer, resolve;
  };

  GlViewRenderer(std::unique_ptr<EglContext> context, Program program)
      : context_(std::move(context)),
        program_(std::move(program)),
        vertices_(*context_, "view vertices"),
        vertex_array_(*context_, "view"),
        white_(*context_, "white", GL_TEXTURE_2D) {
    const auto array = vertex_array_.name();
    glVertexArrayVertexBuffer(array, 0, vertices_.name(), 0, sizeof(ViewVertex));
    const auto attribute = [&](GLuint index, GLint size, std::size_t offset) {
      glEnableVertexArrayAttrib(array, index);
      glVertexArrayAttribFormat(array, index, size, GL_FLOAT, GL_FALSE, static_cast<GLuint>(offset));
      glVertexArrayAttribBinding(array, index, 0);
    };
    attribute(0, 3, offsetof(ViewVertex, position));
    attribute(1, 3, offsetof(ViewVertex, normal));
    attribute(2, 4, offsetof(ViewVertex, color));
    attribute(3, 4, offsetof(ViewVertex, uv));
    attribute(4, 2, offsetof(ViewVertex, lightmap_uv));
    attribute(6, 4, offsetof(ViewVertex, shine_uv));
    attribute(5, 3, offsetof(ViewVertex, emission));
    const std::array<float, 4> one{1.0F, 1.0F, 1.0F, 1.0F};
    glTextureStorage2D(white_.name(), 1, GL_RGBA8, 1, 1);
    glTextureSubImage2D(white_.name(), 0, 0, 0, 1, 1, GL_RGBA, GL_FLOAT, one.data());
  }

  Target makeTarget(int width, int height) {
    Target target{Texture(*context_, "picture", GL_TEXTURE_2D_MULTISAMPLE),
                  Texture(*context_, "picture depth", GL_TEXTURE_2D_MULTISAMPLE),
                  Texture(*context_, "picture resolved", GL_TEXTURE_2D), Framebuffer(*context_, "picture"),
                  Framebuffer(*context_, "picture resolved")};
    glTextureStorage2DMultisample(target.color.name(), kSamples, GL_RGBA32F, width, height, GL_TRUE);
    glTextureStorage2DMultisample(target.depth.name(), kSamples, GL_DEPTH_COMPONENT32F, width, height, GL_TRUE);
    glTextureStorage2D(target.resolved.name(), 1, GL_RGBA32F, width, height);
    glNamedFramebufferTexture(target.framebuffer.name(), GL_COLOR_ATTACHMENT0, target.color.name(), 0);
    glNamedFramebufferTexture(target.framebuffer.name(), GL_DEPTH_ATTACHMENT, target.depth.name(), 0);
    glNamedFramebufferTexture(target.resolve.name(), GL_COLOR_ATTACHMENT0, target.resolved.name(), 0);
    return target;
  }

  void setState(const ViewRequest& request, const Tile& tile, const Target& target) const {
    glViewport(-tile.x, -tile.y, request.width, request.height);
    glClipControl(GL_LOWER_LEFT, GL_ZERO_TO_ONE);
    glEnable(GL_DEPTH_TEST);
    glDepthFunc(GL_GREATER);
    glEnable(GL_MULTISAMPLE);
    glEnable(GL_CULL_FACE);  // each side that is seen is there by itself
    glCullFace(GL_BACK);
    glBindFramebuffer(GL_FRAMEBUFFER, target.framebuffer.name());
    const std::array<float, 4> black{};
    const float far_depth = 0.0F;
    glClearNamedFramebufferfv(target.framebuffer.name(), GL_COLOR, 0, black.data());
    glClearNamedFramebufferfv(target.framebuffer.name(), GL_DEPTH, 0, &far_depth);
    glUseProgram(program_.name());
    glBindVertexArray(vertex_array_.name());
    // The eye is the origin of the vertices, so only the rotation is left of the camera's placement.
    const auto rotation = glm::mat4(glm::transpose(glm::mat3(request.camera.world)));
    const auto clip = projection(request.camera, request.width, request.height) * rotation;
    glProgramUniformMatrix4fv(program_.name(), kClipFromView, 1, GL_FALSE, glm::value_ptr(clip));
    glProgramUniform1i(program_.name(), kQuantity, static_cast<GLint>(request.quantity));
  }

  void draw(const scene::Scene& scene, std::span<const Texture> lightmaps, const ViewGeometry& geometry,
            std::map<std::uint32_t, Texture>& textures) {
    for (const auto& draw : geometry.draws) {
      const auto& material = scene.materials[draw.material];
      bindTexture(0, scene, material.base_color_texture, textures);
      bindTexture(1, scene, material.emissive_texture, textures);
      bindTexture(3, scene, material.metallic_texture, textures);
      bindTexture(4, scene, material.specular_texture, textures);
      glProgramUniform1f(program_.name(), kMetallic, material.metallic);
      glProgramUniform3fv(program_.name(), kSpecular, 1, glm::value_ptr(material.specular));
      glBindTextureUnit(2, draw.page < lightmaps.size() ? lightmaps[draw.page].name() : black());
      const bool masked = material.alpha_mode == scene::AlphaMode::kMask;
      const bool blended = material.alpha_mode == scene::AlphaMode::kBlend;
      const float cutoff = masked ? material.alpha_cutoff : blended ? -2.0F : -1.0F;
      glProgramUniform1f(program_.name(), kAlphaCutoff, cutoff);
      glProgramUniform1f(program_.name(), kBaseAlpha, material.alpha);
      glDrawArrays(GL_TRIANGLES, static_cast<GLint>(draw.first), static_cast<GLsizei>(draw.count));
    }
  }

  /// False colours span the data's own range for errors, and 16 levels for mip levels.
  static float dataScale(std::span<const Image> pages, ViewQuantity quantity) {
    if (quantity == ViewQuantity::kMipLevel) return 1.0F / 16.0F;
    float largest = 0.0F;
    for (const auto& page : pages) {
      for (const auto& texel : page.pixels) largest = std::max(largest, (texel.x + texel.y + texel.z) / 3.0F);
    }
    return largest > 0.0F ? 1.0F / largest : 0.0F;
  }

  std::vector<Texture> uploadPages(std::span<const Image> pages) const {
    std::vector<Texture> textures;
    for (const auto& page : pages) {
      Texture texture(*context_, "lightmap", GL_TEXTURE_2D);
      const auto name = texture.name();
      glTextureStorage2D(name, 1, GL_RGB32F, std::max(page.width, 1), std::max(page.height, 1));
      if (!page.pixels.empty()) {
        glTextureSubImage2D(name, 0, 0, 0, page.width, page.height, GL_RGB, GL_FLOAT, page.pixels.data());
      }
      setSampling(name, GL_LINEAR, GL_CLAMP_TO_EDGE, GL_CLAMP_TO_EDGE);
      textures.push_back(std::move(texture));
    }
    return textures;
  }

  void bindTexture(GLuint unit, const scene::Scene& scene, const scene::TextureUse& use,
                   std::map<std::uint32_t, Texture>& textures) {
    if (use.texture >= scene.textures.size() || scene.textures[use.texture].width < 1) {
      glBindTextureUnit(unit, white_.name());
      return;
    }
    auto found = textures.find(use.texture);
    if (found == textures.end()) found = textures.emplace(use.texture, upload(scene.textures[use.texture])).first;
    const auto wrap = [](bool repeat, bool mirror) {
      if (mirror) return GL_MIRRORED_REPEAT;
      return repeat ? GL_REPEAT : GL_CLAMP_TO_EDGE;
    };
    // One texture may be used with several wrappings, one draw at a time.
    setSampling(found->second.name(), GL_LINEAR_MIPMAP_LINEAR, wrap(use.repeat_u, use.mirror_u),
                wrap(use.repeat_v, use.mirror_v), use.nearest ? GL_NEAREST : GL_LINEAR);
    glBindTextureUnit(unit, found->second.name());
  }

  [[nodiscard]] Texture upload(const scene::Texture& from) const {
    Texture texture(*context_, "material texture", GL_TEXTURE_2D);
    const auto levels = 1 + static_cast<GLsizei>(std::log2(std::max(from.width, from.height)));
    glTextureStorage2D(texture.name(), levels, from.srgb ? GL_SRGB8_ALPHA8 : GL_RGBA8, from.width, from.height);
    glTextureSubImage2D(texture.name(), 0, 0, 0, from.width, from.height, GL_RGBA, GL_UNSIGNED_BYTE, from.rgba.data());
    glGenerateTextureMipmap(texture.name());
    return texture;
  }

  static void setSampling(GLuint texture, GLenum minify, GLenum wrap_u, GLenum wrap_v, GLenum magnify = GL_LINEAR) {
    glTextureParameteri(texture, GL_TEXTURE_MIN_FILTER, static_cast<GLint>(minify));
    glTextureParameteri(texture, GL_TEXTURE_MAG_FILTER, static_cast<GLint>(magnify));
    glTextureParameteri(texture, GL_TEXTURE_WRAP_S, static_cast<GLint>(wrap_u));
    glTextureParameteri(texture, GL_TEXTURE_WRAP_T, static_cast<GLint>(wrap_v));
  }

  /// A page that was not given is dark.
  GLuint black() {
    if (black_.name() == 0) {
      black_ = Texture(*context_, "black", GL_TEXTURE_2D);
      const std::array<float, 4> zero{};
      glTextureStorage2D(black_.name(), 1, GL_RGBA8, 1, 1);
      glTextureSubImage2D(black_.name(), 0, 0, 0, 1, 1, GL_RGBA, GL_FLOAT, zero.data());
    }
    return black_.name();
  }

  static void read(const Tile& tile, const Target& target, ViewPicture& picture) {
    const int w = tile.width;
    const int h = tile.height;
    glBlitNamedFramebuffer(target.framebuffer.name(), target.resolve.name(), 0, 0, w, h, 0, 0, w, h,
                           GL_COLOR_BUFFER_BIT, GL_NEAREST);
    const auto row = static_cast<std::size_t>(w);
    std::vector<glm::vec4> samples(row * static_cast<std::size_t>(h));
    glPixelStorei(GL_PACK_ALIGNMENT, 4);
    glGetTextureSubImage(target.resolved.name(), 0, 0, 0, 0, w, h, 1, GL_RGBA, GL_FLOAT,
                         static_cast<GLsizei>(samples.size() * sizeof(glm::vec4)), samples.data());
    const auto width = static_cast<std::size_t>(picture.image.width);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      const auto bottom = static_cast<std::size_t>(picture.image.height - 1 - tile.y);
      const auto pixel = (bottom - i / row) * width + static_cast<std::size_t>(tile.x) + i % row;
      picture.image.pixels[pixel] = glm::vec3(samples[i]);
      picture.cover[pixel] = samples[i].w;
    }
  }

  std::unique_ptr<EglContext> context_;
  Program program_;
  Buffer vertices_;
  VertexArray vertex_array_;
  Texture white_, black_;
};

}  // namespace

Result<std::unique_ptr<ViewRenderer>> makeViewRenderer() { return GlViewRenderer::create(); }

}  // namespace radiosity::gpu
