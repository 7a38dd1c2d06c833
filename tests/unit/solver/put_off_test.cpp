// Measurements that are put off are done later, once each: the light is the same.
#include <gtest/gtest.h>

#include <vector>

#include "server/solver/pipeline/make_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;

/// Puts off two of three batches that may be: of their shots so many are done that it differs from call to call.
class PuttingOff final : public Transport {
 public:
  Result<void> setScene(std::shared_ptr<const scene::PatchScene> patches) override {
    patches_ = patches;
    return rays_.setScene(std::move(patches));
  }
  Result<TransportCounters> run(const ShotBatch& batch, FluxAccumulators& into) override {
    if (batch.may_be_put_off && ++calls % 3 != 0) return fail(ErrorCode::kCancelled, "put off");
    return rays_.run(batch, into);
  }
  Result<TransportCounters> measure(const ShotBatch& batch, const TakeLinks& take) override {
    if (!batch.may_be_put_off || ++calls % 3 == 0) return rays_.measure(batch, take);
    const std::size_t most = calls % 5;
    const auto done = rays_.measure(batch, [&](std::size_t shot, LinkSample&& links) {
      if (shot < most) take(shot, std::move(links));
    });
    if (!done) return done;
    return fail(ErrorCode::kCancelled, "put off");
  }
  [[nodiscard]] std::string description() const override { return "rays, put off"; }

  std::size_t calls = 0;

 protected:
  [[nodiscard]] std::shared_ptr<const scene::PatchScene> scene() const override { return patches_; }

 private:
  std::shared_ptr<const scene::PatchScene> patches_;
  test::RayTransport rays_{64};
};

std::vector<glm::vec3> solved(Transport& transport, const SolverSettings& settings) {
  auto scene = makeQuadScene(cubeQuads(6, {0, 0, 0, 0, 0, 9}, test::kGrey));
  EXPECT_TRUE(transport.setScene(scene.patches));
  LightSources sources;
  sources.lights.push_back({.position = {0.2, 0.1, 0.0}, .intensity = glm::vec3(2.0F)});
  const auto solver = makeSolver(scene.patches, scene.materials, transport, settings, sources);
  (void)test::runToEnd(*solver);
  return solver->irradiance();
}

void expectTheSameLight(const SolverSettings& settings) {
  test::RayTransport prompt(64);
  PuttingOff put_off;
  const auto expected = solved(prompt, settings);
  EXPECT_EQ(solved(put_off, settings), expected);
  EXPECT_GT(put_off.calls, 6U);
}

TEST(PutOff, measurementsGiveTheSameLight) {
  SolverSettings settings;
  settings.target_error = 0.05;
  expectTheSameLight(settings);
}

TEST(PutOff, slicesOfWavesGiveTheSameLight) {
  SolverSettings settings;
  settings.method = Method::kShooting;
  settings.target_error = 0.1;
  expectTheSameLight(settings);
}

}  // namespace
}  // namespace radiosity::solver
