// Casts rays by compute shaders and measures how long the card takes. One thread.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "common/result.h"
#include "server/gpu/gl/egl_context.h"
#include "server/gpu/gl/gl_objects.h"
#include "tests/benchmark/gpu_rays/ray_sets.h"
#include "tests/benchmark/gpu_rays/wide_tree.h"

namespace radiosity::benchmarks {

/// How rays are cast.
struct Variant {
  std::uint32_t width = 8;         ///< of the tree: 2, 4, 8
  std::uint32_t shared_stack = 0;  ///< entries of it that threads of a group have in its shared memory
  std::uint32_t group = 64;        ///< threads
  bool whole_loops = false;        ///< goes down to a leaf, or through all triangles of a node, before others go on
  std::uint32_t fetching = 0;      ///< threads in all, each of which takes the next ray when it is done; 0: one a ray

  auto operator<=>(const Variant&) const = default;
};

/// A compute shader of files that lie in `folder`, put together behind the defines.
[[nodiscard]] Result<gpu::Program> buildComputeProgram(const gpu::EglContext& context, const std::string& folder,
                                                       const std::vector<std::string>& files,
                                                       const std::vector<std::string>& defines);

/// Of repeated measurements, seconds.
[[nodiscard]] double median(std::vector<double> values);

/// Seconds that the card takes for what `work` asks of it: of each of so many times, once it has done so for a tenth of
/// a second, since cards that had nothing to do run at a fraction of their speed. A software renderer has no such
/// clock: by the wall.
template <typename Work>
[[nodiscard]] std::vector<double> timeOnCard(const gpu::EglContext& context, int times, const Work& work) {
  using Clock = std::chrono::steady_clock;
  std::vector<double> seconds;
  GLuint query = 0;
  glCreateQueries(GL_TIME_ELAPSED, 1, &query);
  const auto warm = Clock::now() + std::chrono::milliseconds(context.software() ? 0 : 100);
  do {
    work();
    glFinish();
  } while (Clock::now() < warm);
  for (int i = 0; i < times; ++i) {
    const auto begin = Clock::now();
    glBeginQuery(GL_TIME_ELAPSED, query);
    work();
    glEndQuery(GL_TIME_ELAPSED);
    glFinish();
    const double passed = std::chrono::duration<double>(Clock::now() - begin).count();
    GLuint64 nanoseconds = 0;
    glGetQueryObjectui64v(query, GL_QUERY_RESULT, &nanoseconds);
    seconds.push_back(context.software() ? passed : 1e-9 * static_cast<double>(nanoseconds));
  }
  glDeleteQueries(1, &query);
  return seconds;
}

class RayCaster {
 public:
  RayCaster(const gpu::EglContext& context, std::string shader_folder);

  void setTree(const WideTree& tree, std::span<const scene::Bvh::Triangle> triangles);
  void setRays(const RaySet& set);

  struct Cast {
    double seconds = 0.0;  ///< median
    std::vector<std::uint32_t> hits;
  };
  /// kTooLarge: the stack is too small for the tree.
  [[nodiscard]] Result<Cast> cast(const Variant& variant, int times);

 private:
  [[nodiscard]] Result<const gpu::Program*> programOf(const Variant& variant);

  const gpu::EglContext& context_;
  std::string folder_;
  gpu::Buffer rays_, nodes_, triangles_, hits_, next_;
  std::uint32_t depth_ = 0, width_ = 0, count_ = 0;
  bool any_ = false;
  std::map<std::pair<Variant, bool>, gpu::Program> programs_;
};

}  // namespace radiosity::benchmarks
