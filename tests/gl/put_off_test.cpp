// A batch that whoever asked for it has no time for any more: what is done stays, what is not leaves nothing behind.
#include <gtest/gtest.h>

#include <chrono>
#include <vector>

#include "server/gpu/workers/gpu_transport.h"
#include "tests/gl/mixed_batch.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

using Clock = std::chrono::steady_clock;

class PutOff : public ::testing::Test {
 protected:
  void SetUp() override { start(gpu::Sight::kRays); }
  void start(gpu::Sight sight) {
    sight_ = sight;
    auto made = gpu::makeWorkerTransport({.workers = 2, .executable = RADIOSITY_GL_WORKER, .sight = sight});
    if (!made) GTEST_SKIP() << made.error().text();
    transport_ = std::move(*made);
    ASSERT_TRUE(transport_->setScene(scene_));
  }
  /// Its lights are looked at from so many points that each takes half a minute.
  [[nodiscard]] solver::ShotBatch endless() const {
    auto batch = mixedBatch(*scene_, 4);
    batch.may_be_put_off = true;
    const std::vector<solver::HemicubeFrame> few = batch.points;
    for (auto& shot : batch.gather) {
      const auto frame = few[shot.first_point];
      shot.first_point = static_cast<std::uint32_t>(batch.points.size());
      shot.point_count = 2'000;
      batch.points.insert(batch.points.end(), shot.point_count, frame);
    }
    return batch;
  }
  void expectWorkersAsEver() {
    const auto batch = mixedBatch(*scene_, 20);
    auto expected = accumulators(*scene_), flux = accumulators(*scene_);
    auto fresh = gpu::makeWorkerTransport({.workers = 2, .executable = RADIOSITY_GL_WORKER, .sight = sight_});
    ASSERT_TRUE(fresh);
    ASSERT_TRUE((*fresh)->setScene(scene_));
    ASSERT_TRUE((*fresh)->run(batch, expected));
    ASSERT_TRUE(transport_->run(batch, flux));
    expectSame(flux, expected);
    EXPECT_EQ(transport_->losses().count, 0U);
  }

  std::shared_ptr<const scene::PatchScene> scene_ = randomRoom(402, 13742, 2);
  std::unique_ptr<solver::Transport> transport_;
  gpu::Sight sight_ = gpu::Sight::kRays;
};

// Whoever asks without a pause only delays it: each time that nothing came of it, it is left alone twice as long.
TEST_F(PutOff, aLongShotIsDoneInTheEndHoweverOftenSomebodyIsWaiting) {
  start(gpu::Sight::kImages);
  transport_->setImpatience([] { return true; });
  auto batch = endless();
  batch.scatter.clear();
  batch.gather.resize(1);
  batch.gather[0].point_count = 1'000;
  std::size_t taken = 0, tries = 0;
  while (taken == 0 && ++tries < 12) {
    const auto done = transport_->measure(batch, [&](std::size_t, auto&&) { ++taken; });
    ASSERT_TRUE(done || done.error().code == ErrorCode::kCancelled);
  }
  EXPECT_EQ(taken, 1U);
  EXPECT_GT(tries, 1U) << "it took less than it is left alone for at first, and shows nothing";
}

// By rays nothing that was found is lost, so that it need not be left alone for longer and longer.
TEST_F(PutOff, aLongShotByRaysGoesOnFromWhereItWas) {
  auto batch = endless();
  batch.scatter.clear();
  batch.gather.resize(1);
  batch.gather[0].point_count = 4'000;  // with those of the next
  std::vector<solver::LinkSample> whole, in_parts;
  auto undisturbed = batch;
  undisturbed.may_be_put_off = false;
  ASSERT_TRUE(transport_->measure(undisturbed, [&](std::size_t, auto&& links) { whole.push_back(links); }));
  transport_->setImpatience([] { return true; });
  std::size_t tries = 0;
  auto longest = Clock::duration::zero();
  while (in_parts.empty() && ++tries < 10'000) {
    const auto begun = Clock::now();
    const auto done = transport_->measure(batch, [&](std::size_t, auto&& links) { in_parts.push_back(links); });
    ASSERT_TRUE(done || done.error().code == ErrorCode::kCancelled);
    longest = std::max(longest, Clock::now() - begun);
  }
  // Left alone for twice as long each time it would take seven.
  EXPECT_GT(tries, 12U) << "it is left alone for longer and longer, or took too little to show anything";
  ASSERT_EQ(in_parts.size(), 1U);
  EXPECT_EQ(in_parts[0].irradiance, whole[0].irradiance);
  EXPECT_EQ(in_parts[0].escaped, whole[0].escaped);
  EXPECT_EQ(in_parts[0].absorbed, whole[0].absorbed);
  EXPECT_LT(longest, std::chrono::seconds(10));
  expectWorkersAsEver();
}

// What was begun is of no use to another shot.
TEST_F(PutOff, anotherShotBeginsAnew) {
  auto batch = endless();
  batch.scatter.clear();
  batch.gather.resize(1);
  transport_->setImpatience([] { return true; });
  ASSERT_FALSE(transport_->measure(batch, [](std::size_t, auto&&) { ADD_FAILURE() << "a shot is done"; }));
  auto other = batch;
  other.may_be_put_off = false;
  other.gather[0].point_count = 3;
  other.gather[0].receiver_jitter = {0.25F, 0.75F};
  std::vector<solver::LinkSample> after, fresh;
  ASSERT_TRUE(transport_->measure(other, [&](std::size_t, auto&& links) { after.push_back(links); }));
  start(gpu::Sight::kRays);
  ASSERT_TRUE(transport_->measure(other, [&](std::size_t, auto&& links) { fresh.push_back(links); }));
  EXPECT_EQ(after[0].irradiance, fresh[0].irradiance);
  EXPECT_EQ(after[0].escaped, fresh[0].escaped);
}

TEST_F(PutOff, aMeasurementInTheMiddleOfAShotEndsSoon) {
  transport_->setImpatience([] { return true; });
  const auto begun = Clock::now();
  const auto done = transport_->measure(endless(), [](std::size_t, auto&&) { ADD_FAILURE() << "a shot is done"; });
  EXPECT_LT(Clock::now() - begun, std::chrono::seconds(10));
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kCancelled);
  expectWorkersAsEver();
}

TEST_F(PutOff, ofARunNothingStays) {
  transport_->setImpatience([] { return true; });
  auto flux = accumulators(*scene_);
  const auto done = transport_->run(endless(), flux);
  ASSERT_FALSE(done);
  EXPECT_EQ(done.error().code, ErrorCode::kCancelled);
  expectSame(flux, accumulators(*scene_));
  expectWorkersAsEver();
}

TEST_F(PutOff, betweenTwoImagesTooOfScatterShotsAsWell) {
  start(gpu::Sight::kImages);
  transport_->setImpatience([] { return true; });
  auto batch = endless();
  auto flux = accumulators(*scene_);
  for (const bool by_scatter : {false, true}) {
    if (by_scatter) {
      batch.gather.clear();
      batch.scatter.assign(20'000, batch.scatter.front());
    }
    const auto begun = Clock::now();
    const auto done = transport_->run(batch, flux);
    EXPECT_LT(Clock::now() - begun, std::chrono::seconds(10)) << by_scatter;
    ASSERT_FALSE(done) << by_scatter;
    EXPECT_EQ(done.error().code, ErrorCode::kCancelled);
    expectSame(flux, accumulators(*scene_));
  }
  expectWorkersAsEver();
}

TEST_F(PutOff, theShotsThatWereTakenAreTheFirstAndWhole) {
  auto batch = mixedBatch(*scene_, 3000);
  std::vector<solver::LinkSample> all, taken;
  ASSERT_TRUE(transport_->measure(batch, [&](std::size_t, auto&& links) { all.push_back(links); }));
  batch.may_be_put_off = true;
  transport_->setImpatience([] { return true; });
  const auto done = transport_->measure(batch, [&](std::size_t shot, auto&& links) {
    EXPECT_EQ(shot, taken.size());
    taken.push_back(links);
  });
  EXPECT_EQ(done.has_value(), taken.size() == all.size());
  ASSERT_LE(taken.size(), all.size());
  for (std::size_t i = 0; i < taken.size(); ++i) EXPECT_EQ(taken[i].irradiance, all[i].irradiance) << i;
  expectWorkersAsEver();
}

TEST_F(PutOff, onlyWhatMayBeIs) {
  transport_->setImpatience([] { return true; });
  std::size_t taken = 0;
  EXPECT_TRUE(transport_->measure(mixedBatch(*scene_, 600), [&](std::size_t, auto&&) { ++taken; }));
  EXPECT_EQ(taken, 603U);
}

}  // namespace
}  // namespace radiosity::test
