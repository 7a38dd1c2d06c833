#include <algorithm>
#include <array>
#include <cstring>

#include "common/check.h"
#include "server/gpu/gl/gl_objects.h"
#include "server/gpu/gl/shader_source.h"

namespace radiosity::gpu {
namespace {

const char* findShader(std::string_view name) {
  for (const auto* shader = kEmbeddedShaders; shader->name != nullptr; ++shader) {
    if (name == shader->name) return shader->source;
  }
  detail::checkFailed(__FILE__, __LINE__, "no embedded shader " + std::string(name));
}

/// `before`: source that goes in front of the shader's own.
Result<GLuint> compile(GLenum kind, std::string_view name, const std::string& preamble, const char* before = "") {
  const GLuint shader = glCreateShader(kind);
  const std::array<const char*, 5> sources{preamble.c_str(), kShaderConstants, before, "\n#line 1\n", findShader(name)};
  glShaderSource(shader, static_cast<GLsizei>(sources.size()), sources.data(), nullptr);
  glCompileShader(shader);
  GLint compiled = GL_FALSE;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &compiled);
  if (compiled == GL_TRUE) return shader;
  std::string text(4096, '\0');
  GLsizei length = 0;
  glGetShaderInfoLog(shader, static_cast<GLsizei>(text.size()), &length, text.data());
  text.resize(static_cast<std::size_t>(length));
  glDeleteShader(shader);
  return fail(ErrorCode::kInternal, "shader does not compile: " + text, std::string(name));
}

}  // namespace

Result<Program> buildProgram(const EglContext& context, std::string_view vertex_shader,
                             std::string_view fragment_shader, const std::vector<std::string>& defines) {
  context.makeCurrent();
  std::string preamble = "#version 450 core\n#extension GL_ARB_shader_viewport_layer_array : enable\n";
  for (const auto& define : defines) preamble += "#define " + define + "\n";
  const auto vertex = compile(GL_VERTEX_SHADER, vertex_shader, preamble);
  if (!vertex) return tl::unexpected(vertex.error());
  const bool see_through = std::find(defines.begin(), defines.end(), kSeeThrough) != defines.end();
  const auto fragment =
      compile(GL_FRAGMENT_SHADER, fragment_shader, preamble, see_through ? findShader("see_through.frag") : "");
  if (!fragment) {
    glDeleteShader(*vertex);
    return tl::unexpected(fragment.error());
  }
  Program program(context, std::string(vertex_shader) + "+" + std::string(fragment_shader));
  for (const auto shader : {*vertex, *fragment}) {
    glAttachShader(program.name(), shader);
    glDeleteShader(shader);
  }
  glLinkProgram(program.name());
  GLint linked = GL_FALSE;
  glGetProgramiv(program.name(), GL_LINK_STATUS, &linked);
  if (linked == GL_TRUE) return program;
  std::string text(4096, '\0');
  GLsizei length = 0;
  glGetProgramInfoLog(program.name(), static_cast<GLsizei>(text.size()), &length, text.data());
  text.resize(static_cast<std::size_t>(length));
  return fail(ErrorCode::kInternal, "shaders do not link: " + text, std::string(fragment_shader));
}

}  // namespace radiosity::gpu
