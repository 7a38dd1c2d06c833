#include "tests/benchmark/gpu_rays/sweep.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/vec4.hpp>
#include <span>

#include "common/log.h"
#include "server/gpu/gl/gl_objects.h"
#include "server/solver/math/sampling.h"
#include "tests/benchmark/gpu_rays/ray_caster.h"

namespace radiosity::benchmarks {
namespace {

constexpr int kInARow = 10;
constexpr float kMostReflected = 0.8F;

float uniform(std::uint64_t a, std::uint64_t b) {
  return static_cast<float>(solver::uniformFromKey(solver::mixKeys(a, b)));
}

struct Equation {
  std::uint32_t leaves = 0, of_each = 0;
  std::vector<std::uint32_t> hits;  ///< leaf after leaf
  std::vector<glm::vec4> emission, reflectance, sent;
};

Equation makeEquation(const std::vector<std::uint32_t>& hits, std::uint32_t of_each, std::uint32_t copies) {
  Equation made;
  const auto before = static_cast<std::uint32_t>(hits.size() / of_each);
  made.leaves = before * copies;
  made.of_each = of_each;
  made.hits.resize(std::size_t{made.leaves} * of_each);
  for (std::size_t i = 0; i < made.hits.size(); ++i) {
    const auto leaf = i / of_each;
    const auto hit = hits[leaf / copies * of_each + i % of_each];
    const auto copy = static_cast<std::uint32_t>(solver::mixKeys(i, 1) % copies);
    made.hits[i] = hit == before ? made.leaves : hit * copies + copy;
  }
  for (std::uint32_t leaf = 0; leaf < made.leaves; ++leaf) {
    const auto at = [&](std::uint64_t k) { return uniform(leaf, k); };
    made.emission.emplace_back(at(0), at(1), at(2), 0.0F);
    made.reflectance.emplace_back(kMostReflected * at(3), kMostReflected * at(4), kMostReflected * at(5), 0.0F);
    made.sent.emplace_back(at(6), at(7), at(8), 0.0F);
  }
  made.sent.emplace_back(0.0F);
  return made;
}

double greatestError(const Equation& equation, const std::vector<glm::vec4>& sends) {
  double most = 0.0, largest = 0.0;
  for (std::size_t leaf = 0; leaf < equation.leaves; ++leaf) {
    glm::dvec4 sum(0.0);
    for (std::size_t k = 0; k < equation.of_each; ++k)
      sum += glm::dvec4(equation.sent[equation.hits[leaf * equation.of_each + k]]);
    const auto right = glm::dvec4(equation.emission[leaf]) +
                       glm::dvec4(equation.reflectance[leaf]) * (sum / static_cast<double>(equation.of_each));
    for (int c = 0; c < 3; ++c) {
      const double error = std::abs(right[c] - static_cast<double>(sends[leaf][c]));
      most = std::isfinite(error) ? std::max(most, error) : HUGE_VAL;
      largest = std::max(largest, std::abs(right[c]));
    }
  }
  return most / largest;
}

std::vector<std::uint32_t> transposed(const Equation& equation) {
  std::vector<std::uint32_t> turned(equation.hits.size());
  for (std::size_t leaf = 0; leaf < equation.leaves; ++leaf)
    for (std::size_t k = 0; k < equation.of_each; ++k)
      turned[k * equation.leaves + leaf] = equation.hits[leaf * equation.of_each + k];
  return turned;
}

/// The equation as the card has it.
class SweepBuffers {
 public:
  SweepBuffers(const gpu::EglContext& context, const Equation& equation)
      : equation_(equation),
        hits_(context, "hits"),
        reflectance_(context, "reflectance"),
        emission_(context, "emission") {
    gpu::fill(reflectance_, std::span(equation.reflectance), GL_STATIC_DRAW);
    gpu::fill(emission_, std::span(equation.emission), GL_STATIC_DRAW);
    for (auto& light : light_) {
      light = gpu::Buffer(context, "light");
      gpu::fill(light, std::span(equation.sent), GL_DYNAMIC_COPY);
    }
  }
  void setHits(const std::vector<std::uint32_t>& hits) { gpu::fill(hits_, std::span(hits), GL_STATIC_DRAW); }
  /// From light `from` into the other.
  void sweep(std::uint32_t group, std::size_t from) const {
    const GLuint buffers[] = {hits_.name(), light_[from].name(), reflectance_.name(), emission_.name(),
                              light_[1 - from].name()};
    glBindBuffersBase(GL_SHADER_STORAGE_BUFFER, 0, 5, buffers);
    glDispatchCompute((equation_.leaves + group - 1) / group, 1, 1);
    glMemoryBarrier(GL_ALL_BARRIER_BITS);
  }
  /// Of one sweep from what is sent at first.
  [[nodiscard]] double error(std::uint32_t group) const {
    gpu::fill(light_[0], std::span(equation_.sent), GL_DYNAMIC_COPY);
    sweep(group, 0);
    std::vector<glm::vec4> sends(equation_.leaves);
    glGetNamedBufferSubData(light_[1].name(), 0, static_cast<GLsizeiptr>(sends.size() * sizeof(glm::vec4)),
                            sends.data());
    return greatestError(equation_, sends);
  }

 private:
  const Equation& equation_;
  gpu::Buffer hits_, reflectance_, emission_;
  std::array<gpu::Buffer, 2> light_;
};

}  // namespace

Result<std::vector<SweepTimes>> timeSweeps(const gpu::EglContext& context, const std::string& folder,
                                           const std::vector<std::uint32_t>& hits, std::uint32_t of_each,
                                           std::uint32_t copies, int times) {
  const auto equation = makeEquation(hits, of_each, copies);
  SweepBuffers buffers(context, equation);
  std::vector<SweepTimes> all;
  for (const bool turned : {false, true}) {
    buffers.setHits(turned ? transposed(equation) : equation.hits);
    for (const std::uint32_t group : {64U, 256U}) {
      std::vector<std::string> defines{fmt::format("GROUP {}", group), fmt::format("HITS {}u", of_each)};
      if (turned) defines.emplace_back("TRANSPOSED");
      const auto program = buildComputeProgram(context, folder, {"sweep.comp"}, defines);
      if (!program) return tl::unexpected(program.error());
      glUseProgram(program->name());
      glProgramUniform1ui(program->name(), 0, equation.leaves);
      SweepTimes made{equation.leaves, of_each, group, turned, 0.0, 0.0, buffers.error(group)};
      made.seconds = median(timeOnCard(context, times,
                                       [&] {
                                         for (std::size_t i = 0; i < kInARow; ++i) buffers.sweep(group, i % 2);
                                       })) /
                     kInARow;
      made.bytes = static_cast<double>(equation.leaves) * (20.0 * of_each + 48.0);
      all.push_back(made);
    }
  }
  if (const auto checked = context.check(); !checked) return tl::unexpected(checked.error());
  return all;
}

Result<double> timeRoundTrip(const gpu::EglContext& context, const std::string& folder) {
  const Equation equation = makeEquation({0, 0}, 2, 1);
  SweepBuffers buffers(context, equation);
  buffers.setHits(equation.hits);
  const auto program = buildComputeProgram(context, folder, {"sweep.comp"}, {"GROUP 64", "HITS 2u"});
  if (!program) return tl::unexpected(program.error());
  glUseProgram(program->name());
  glProgramUniform1ui(program->name(), 0, equation.leaves);
  std::vector<double> seconds;
  constexpr int kTimes = 101;
  for (int i = 0; i < kTimes; ++i) {
    const auto begin = std::chrono::steady_clock::now();
    buffers.sweep(64, static_cast<std::size_t>(i % 2));
    const auto fence = glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0);
    glClientWaitSync(fence, GL_SYNC_FLUSH_COMMANDS_BIT, 1'000'000'000);
    glDeleteSync(fence);
    seconds.push_back(std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count());
  }
  return median(seconds);
}

}  // namespace radiosity::benchmarks
