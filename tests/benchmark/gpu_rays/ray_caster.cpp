#include "tests/benchmark/gpu_rays/ray_caster.h"

#include <algorithm>
#include <fstream>
#include <iterator>

#include "common/log.h"

namespace radiosity::benchmarks {
namespace {

/// Entries of a thread's stack.
std::uint32_t stackOf(std::uint32_t width) { return width == 8 ? 32 : width == 4 ? 96 : 64; }

std::string logOf(GLuint name, bool shader) {
  std::string text(4096, '\0');
  GLsizei length = 0;
  const auto size = static_cast<GLsizei>(text.size());
  if (shader) glGetShaderInfoLog(name, size, &length, text.data());
  if (!shader) glGetProgramInfoLog(name, size, &length, text.data());
  text.resize(static_cast<std::size_t>(length));
  return text;
}

}  // namespace

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values.empty() ? 0.0 : values[values.size() / 2];
}

Result<gpu::Program> buildComputeProgram(const gpu::EglContext& context, const std::string& folder,
                                         const std::vector<std::string>& files,
                                         const std::vector<std::string>& defines) {
  context.makeCurrent();
  std::string source = "#version 450 core\n";
  for (const auto& define : defines) source += "#define " + define + "\n";
  for (const auto& file : files) {
    std::ifstream in(folder + "/" + file);
    if (!in) return fail(ErrorCode::kNotFound, "no such shader", folder + "/" + file);
    source += "#line 1\n";
    source.append(std::istreambuf_iterator<char>(in), {});
  }
  const GLuint shader = glCreateShader(GL_COMPUTE_SHADER);
  const char* text = source.c_str();
  glShaderSource(shader, 1, &text, nullptr);
  glCompileShader(shader);
  GLint done = GL_FALSE;
  glGetShaderiv(shader, GL_COMPILE_STATUS, &done);
  if (done != GL_TRUE)
    return fail(ErrorCode::kInternal, "shader does not compile: " + logOf(shader, true), files.back());
  gpu::Program program(context, files.back());
  glAttachShader(program.name(), shader);
  glDeleteShader(shader);
  glLinkProgram(program.name());
  glGetProgramiv(program.name(), GL_LINK_STATUS, &done);
  if (done != GL_TRUE)
    return fail(ErrorCode::kInternal, "shader does not link: " + logOf(program.name(), false), files.back());
  return program;
}

RayCaster::RayCaster(const gpu::EglContext& context, std::string shader_folder)
    : context_(context),
      folder_(std::move(shader_folder)),
      rays_(context, "rays"),
      nodes_(context, "nodes"),
      triangles_(context, "triangles"),
      hits_(context, "hits"),
      next_(context, "next ray") {
  constexpr std::uint32_t kZero = 0;
  gpu::fill(next_, std::span(&kZero, 1), GL_DYNAMIC_COPY);
}

void RayCaster::setTree(const WideTree& tree, std::span<const scene::Bvh::Triangle> triangles) {
  const auto nodes = nodeWords(tree), words = triangleWords(tree, triangles);
  gpu::fill(nodes_, std::span(nodes), GL_STATIC_DRAW);
  gpu::fill(triangles_, std::span(words), GL_STATIC_DRAW);
  depth_ = tree.depth;
  width_ = tree.width;
}

void RayCaster::setRays(const RaySet& set) {
  gpu::fill(rays_, std::span(set.rays), GL_STATIC_DRAW);
  glNamedBufferData(hits_.name(), static_cast<GLsizeiptr>(set.rays.size() * sizeof(std::uint32_t)), nullptr,
                    GL_DYNAMIC_READ);
  count_ = static_cast<std::uint32_t>(set.rays.size());
  any_ = set.any;
}

Result<const gpu::Program*> RayCaster::programOf(const Variant& variant) {
  auto key = std::pair{variant, any_};
  if (key.first.fetching > 0) key.first.fetching = 1;  // however many
  if (const auto found = programs_.find(key); found != programs_.end()) return &found->second;
  std::vector<std::string> defines{fmt::format("GROUP {}", variant.group),
                                   fmt::format("STACK {}", stackOf(variant.width))};
  if (variant.shared_stack > 0) defines.push_back(fmt::format("SHARED_STACK {}", variant.shared_stack));
  if (variant.fetching > 0) defines.emplace_back("PERSISTENT");
  if (variant.whole_loops) defines.emplace_back("WHILE");
  if (any_) defines.emplace_back("ANY");
  std::vector<std::string> files{"rays.comp", fmt::format("tree{}.glsl", variant.width)};
  if (variant.width < 8) files.emplace_back("walk.glsl");
  auto program = buildComputeProgram(context_, folder_, files, defines);
  if (!program) return tl::unexpected(program.error());
  return &programs_.emplace(key, std::move(*program)).first->second;
}

Result<RayCaster::Cast> RayCaster::cast(const Variant& variant, int times) {
  // Of each node all children but one may wait.
  if ((width_ == 8 ? 1 : width_ - 1) * depth_ > stackOf(width_) || width_ != variant.width)
    return fail(ErrorCode::kTooLarge, fmt::format("a tree of depth {} is too deep for the stack", depth_));
  const auto program = programOf(variant);
  if (!program) return tl::unexpected(program.error());
  glUseProgram((*program)->name());
  const GLuint buffers[] = {rays_.name(), nodes_.name(), triangles_.name(), hits_.name(), next_.name()};
  glBindBuffersBase(GL_SHADER_STORAGE_BUFFER, 0, 5, buffers);
  glProgramUniform1ui((*program)->name(), 0, count_);
  constexpr std::uint32_t kNobody = 0xdeadbeef, kZero = 0, kRow = 32768;
  glClearNamedBufferData(hits_.name(), GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &kNobody);
  const auto threads = variant.fetching > 0 ? std::min(variant.fetching, count_) : count_;
  const auto groups = (threads + variant.group - 1) / variant.group;
  Cast made;
  made.seconds = median(timeOnCard(context_, times, [&] {
    if (variant.fetching > 0) {
      glClearNamedBufferData(next_.name(), GL_R32UI, GL_RED_INTEGER, GL_UNSIGNED_INT, &kZero);
      glMemoryBarrier(GL_ALL_BARRIER_BITS);
    }
    glDispatchCompute(std::min(groups, kRow), (groups + kRow - 1) / kRow, 1);
    glMemoryBarrier(GL_ALL_BARRIER_BITS);
  }));
  made.hits.resize(count_);
  glGetNamedBufferSubData(hits_.name(), 0, static_cast<GLsizeiptr>(made.hits.size() * sizeof(std::uint32_t)),
                          made.hits.data());
  if (const auto checked = context_.check(); !checked) return tl::unexpected(checked.error());
  return made;
}

}  // namespace radiosity::benchmarks
