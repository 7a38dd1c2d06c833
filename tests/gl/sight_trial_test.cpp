// The way in which lights see is chosen by trying both.
#include "server/gpu/run/sight_trial.h"

#include <gtest/gtest.h>

#include "server/gpu/workers/gpu_transport.h"
#include "server/scene/charts/trial_room.h"
#include "tests/gl/mixed_batch.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

using gpu::Sight;

Result<std::unique_ptr<solver::Transport>> workersThat(Sight sight) {
  return gpu::makeWorkerTransport(
      {.workers = 1, .executable = RADIOSITY_GL_WORKER, .sight = sight, .make_trial_room = scene::makeTrialRoom});
}

TEST(SightTrial, ImagesMustBeClearlyFaster) {
  EXPECT_EQ(gpu::fasterSight({.rays = 1.0, .images = 0.5}), Sight::kImages);
  EXPECT_EQ(gpu::fasterSight({.rays = 1.0, .images = 0.95}), Sight::kRays);
  EXPECT_EQ(gpu::fasterSight({.rays = 0.5, .images = 1.0}), Sight::kRays);
}

TEST(SightTrial, IsMadeWhereACardDrawsOrItIsAskedFor) {
  EXPECT_FALSE(gpu::wantsTrial(Sight::kAuto, true));
  EXPECT_TRUE(gpu::wantsTrial(Sight::kAuto, false));
  EXPECT_TRUE(gpu::wantsTrial(Sight::kMeasured, true));
  EXPECT_FALSE(gpu::wantsTrial(Sight::kRays, false));
  EXPECT_FALSE(gpu::wantsTrial(Sight::kImages, false));
}

// Both ways bring the same light to the furnished room, so that what is timed is the same work.
TEST(SightTrial, BothWaysLightTheRoomAlike) {
  const auto room = scene::makeTrialRoom();
  ASSERT_TRUE(room) << room.error().text();
  const auto batch = gpu::trialBatch(**room);
  EXPECT_GT((*room)->triangles.size(), 2'500U);
  EXPECT_GT((*room)->leaves.size(), 4'000U);
  std::array<double, 2> sum{};
  for (const auto sight : {Sight::kRays, Sight::kImages}) {
    auto transport = gpu::makeInProcessTransport(0, std::nullopt, sight);
    if (!transport) GTEST_SKIP() << transport.error().text();
    ASSERT_TRUE((*transport)->setScene(*room));
    const auto measured = (*transport)->measure(batch, [&](std::size_t, const solver::LinkSample& links) {
      std::size_t i = 0;
      for (const auto& run : links.runs)
        for (std::uint32_t node = run.first_node; node < run.first_node + run.count; ++node)
          sum[sight == Sight::kRays ? 0 : 1] += static_cast<double>(links.irradiance[i++]) * (*room)->node_area[node];
    });
    ASSERT_TRUE(measured) << measured.error().text();
  }
  // Four lamps of radiosity one send their area, of which little falls on backs.
  const auto box = solver::sceneBox(**room);
  const double side = 0.4 / 6.0 * (box[1].x - box[0].x);
  EXPECT_NEAR(sum[0], 4.0 * side * side, 0.03 * 4.0 * side * side);
  EXPECT_NEAR(sum[1], sum[0], 0.01 * sum[0]);
}

// What was tried before leaves no trace: the same bits as without a trial, and the times are told.
TEST(SightTrial, ChoosesBeforeThereIsAScene) {
  auto tried = workersThat(Sight::kMeasured);
  if (!tried) GTEST_SKIP() << tried.error().text();
  const auto text = (*tried)->description();
  EXPECT_NE(text.find("tried: rays "), std::string::npos) << text;
  solver::FluxAccumulators none;
  EXPECT_FALSE((*tried)->run({}, none)) << "the room of the trial is no scene";
  const bool rays = text.find("lights see by rays") != std::string::npos;
  auto told = workersThat(rays ? Sight::kRays : Sight::kImages);
  ASSERT_TRUE(told);
  EXPECT_EQ((*told)->description().find("tried"), std::string::npos);
  const auto scene = randomRoom(60, 2000, 1);
  const auto batch = mixedBatch(*scene, 101);
  std::array<solver::FluxAccumulators, 2> flux{accumulators(*scene), accumulators(*scene)};
  for (std::size_t i = 0; i < 2; ++i) {
    auto& transport = i == 0 ? **tried : **told;
    ASSERT_TRUE(transport.setScene(scene));
    ASSERT_TRUE(transport.run(batch, flux[i]));
  }
  expectSame(flux[0], flux[1]);
}

}  // namespace
}  // namespace radiosity::test
