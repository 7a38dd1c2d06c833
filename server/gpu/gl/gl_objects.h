// OpenGL objects as move-only values. Each needs a context to be constructed, carries a label for debuggers, and is
// deleted in its own context. Same thread as the context.
#pragma once

#include <epoxy/gl.h>

#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "common/result.h"
#include "server/gpu/gl/egl_context.h"

namespace radiosity::gpu {

template <typename Kind>
class GlObject {
 public:
  GlObject() = default;
  template <typename... Args>
  GlObject(const EglContext& context, std::string_view label, Args... args) : context_(&context) {
    context.makeCurrent();
    name_ = Kind::create(args...);
    glObjectLabel(Kind::kIdentifier, name_, static_cast<GLsizei>(label.size()), label.data());
  }
  ~GlObject() { reset(); }
  GlObject(GlObject&& other) noexcept
      : context_(std::exchange(other.context_, nullptr)), name_(std::exchange(other.name_, 0)) {}
  GlObject& operator=(GlObject&& other) noexcept {
    if (this != &other) {
      reset();
      context_ = std::exchange(other.context_, nullptr);
      name_ = std::exchange(other.name_, 0);
    }
    return *this;
  }
  GlObject(const GlObject&) = delete;
  GlObject& operator=(const GlObject&) = delete;

  [[nodiscard]] GLuint name() const { return name_; }

 private:
  void reset() {
    if (name_ == 0) return;
    context_->makeCurrent();
    Kind::destroy(name_);
    name_ = 0;
  }

  const EglContext* context_ = nullptr;
  GLuint name_ = 0;
};

struct BufferKind {
  static constexpr GLenum kIdentifier = GL_BUFFER;
  static GLuint create() {
    GLuint name = 0;
    glCreateBuffers(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteBuffers(1, &name); }
};
struct TextureKind {
  static constexpr GLenum kIdentifier = GL_TEXTURE;
  static GLuint create(GLenum target) {
    GLuint name = 0;
    glCreateTextures(target, 1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteTextures(1, &name); }
};
struct FramebufferKind {
  static constexpr GLenum kIdentifier = GL_FRAMEBUFFER;
  static GLuint create() {
    GLuint name = 0;
    glCreateFramebuffers(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteFramebuffers(1, &name); }
};
struct VertexArrayKind {
  static constexpr GLenum kIdentifier = GL_VERTEX_ARRAY;
  static GLuint create() {
    GLuint name = 0;
    glCreateVertexArrays(1, &name);
    return name;
  }
  static void destroy(GLuint name) { glDeleteVertexArrays(1, &name); }
};
struct ProgramKind {
  static constexpr GLenum kIdentifier = GL_PROGRAM;
  static GLuint create() { return glCreateProgram(); }
  static void destroy(GLuint name) { glDeleteProgram(name); }
};

using Buffer = GlObject<BufferKind>;
using Texture = GlObject<TextureKind>;
using Framebuffer = GlObject<FramebufferKind>;
using VertexArray = GlObject<VertexArrayKind>;
using Program = GlObject<ProgramKind>;

/// Fills a buffer with the bytes of `values`, replacing what it held (the driver may hand out fresh memory).
template <typename T>
void fill(const Buffer& buffer, std::span<const T> values, GLenum usage) {
  glNamedBufferData(buffer.name(), static_cast<GLsizeiptr>(values.size_bytes()), values.data(), usage);
}

/// The #define of the variants for scenes that one can see through in places: see_through.frag goes in front of the
/// fragment shader, and GpuScene::bindOpacity must come before drawing.
inline constexpr const char* kSeeThrough = "SEE_THROUGH";

/// Compiles and links embedded shaders (by file name), with a #define for each of `defines`. kInternal with the
/// driver's log on failure: a shader that does not compile is our bug or the driver's.
[[nodiscard]] Result<Program> buildProgram(const EglContext& context, std::string_view vertex_shader,
                                           std::string_view fragment_shader,
                                           const std::vector<std::string>& defines = {});

}  // namespace radiosity::gpu
