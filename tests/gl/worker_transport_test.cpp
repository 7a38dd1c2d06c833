// Worker processes: the same bits as one process, whatever the number of workers and whoever dies.
#include <gtest/gtest.h>
#include <sys/types.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <csignal>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <thread>

#include "server/gpu/workers/batch_chunks.h"
#include "server/gpu/workers/gpu_transport.h"
#include "server/solver/transport/shot_cost.h"
#include "tests/gl/mixed_batch.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

/// Processes whose parent is this one and whose executable is the test's worker.
std::vector<pid_t> childWorkers() {
  std::vector<pid_t> found;
  for (const auto& entry : std::filesystem::directory_iterator("/proc")) {
    const auto name = entry.path().filename().string();
    if (name.find_first_not_of("0123456789") != std::string::npos) continue;
    std::ifstream file(entry.path() / "stat");
    std::string line;
    if (!std::getline(file, line)) continue;
    const auto close = line.rfind(')');
    if (close == std::string::npos || line.find("(gl_worker") == std::string::npos) continue;
    const pid_t parent = std::stoi(line.substr(line.find(' ', close + 2)));
    if (parent == getpid()) found.push_back(std::stoi(name));
  }
  return found;
}

double processorSeconds(const std::vector<pid_t>& workers) {
  double sum = 0.0;
  for (const auto worker : workers) {
    clockid_t clock{};
    timespec used{};
    if (clock_getcpuclockid(worker, &clock) != 0 || clock_gettime(clock, &used) != 0) continue;
    sum += static_cast<double>(used.tv_sec) + 1e-9 * static_cast<double>(used.tv_nsec);
  }
  return sum;
}

class Workers : public ::testing::Test {
 protected:
  void SetUp() override {
    auto made = gpu::makeInProcessTransport();
    if (!made) GTEST_SKIP() << made.error().text();
    in_process_ = std::move(*made);
  }
  static std::unique_ptr<solver::Transport> make(int workers,
                                                 std::chrono::milliseconds patience = gpu::WorkerOptions().patience) {
    auto made = gpu::makeWorkerTransport({workers, RADIOSITY_GL_WORKER, patience});
    EXPECT_TRUE(made.has_value()) << made.error().text();
    return made ? std::move(*made) : nullptr;
  }
  static solver::FluxAccumulators run(solver::Transport& transport, const scene::PatchScene& scene,
                                      const solver::ShotBatch& batch) {
    auto flux = accumulators(scene);
    const auto counters = transport.run(batch, flux);
    EXPECT_TRUE(counters.has_value()) << counters.error().text();
    if (counters) {
      EXPECT_EQ(counters->scatter_shots, batch.scatter.size());
      EXPECT_EQ(counters->gather_shots, batch.gather.size());
    }
    return flux;
  }
  std::unique_ptr<solver::Transport> in_process_;
};

TEST(BatchChunks, CoverEveryShotOnce) {
  const auto scene = randomRoom(60, 2000, 1);
  const auto batch = mixedBatch(*scene, 101);
  for (const std::size_t workers : {1U, 2U, 7U}) {
    std::size_t scatter = 0;
    std::size_t gather = 0;
    for (const auto& chunk : gpu::cutBatch(batch, {120, 1000}, {workers, 1})) {
      auto& next = chunk.kind == gpu::ShotKind::kGather ? gather : scatter;
      EXPECT_EQ(chunk.first, next);
      EXPECT_GT(chunk.count, 0U);
      next += chunk.count;
    }
    EXPECT_EQ(scatter, batch.scatter.size());
    EXPECT_EQ(gather, batch.gather.size());
  }
  EXPECT_TRUE(gpu::cutBatch({}, {}, {2, 1}).empty());
}

// So that no worker waits long for another at the end.
TEST(BatchChunks, GetSmallTowardsTheEndOfABatch) {
  const auto scene = randomRoom(60, 2000, 1);
  auto batch = mixedBatch(*scene, 700);
  batch.gather.clear();
  const auto chunks = gpu::cutBatch(batch, {200'000, 1000}, {2, 1});  // of many triangles: each shot costs something
  ASSERT_GT(chunks.size(), 8U);
  EXPECT_LT(chunks.back().cost, 0.25 * chunks.front().cost);
  for (std::size_t i = 1; i < chunks.size(); ++i) EXPECT_LT(chunks[i].cost, 1.3 * chunks[i - 1].cost) << i;
}

TEST(BatchChunks, OfGatheredShotsCountTheReceiversThatLook) {
  const auto scene = randomRoom(60, 2000, 1);
  auto batch = mixedBatch(*scene, 8);
  batch.scatter.clear();
  const auto cost = [&](std::size_t nodes) {
    double sum = 0.0;
    for (const auto& chunk : gpu::cutBatch(batch, {120, nodes}, {2, 1})) sum += chunk.cost;
    return sum;
  };
  ASSERT_EQ(batch.gather.size(), 3U);  // of five points each, all receivers weighed once and looked at from each point
  EXPECT_DOUBLE_EQ(cost(101'000) - cost(1000), 3 * (1 + 5) * 100'000 * solver::ShotCost::kReceiverPixels);
  batch.receivers.push_back({0, 1});
  for (auto& shot : batch.gather) shot.run_count = 1;
  EXPECT_DOUBLE_EQ(cost(101'000), cost(1000)) << "those that are named are few";
}

TEST(BatchChunks, OfScenesWithManyNodesHaveFewShotsSoThatTheirLinksStaySmall) {
  const auto scene = randomRoom(60, 2000, 1);
  const auto batch = mixedBatch(*scene, 400);
  const auto longest = [&](std::size_t nodes) {
    std::size_t most = 0;
    for (const auto& chunk : gpu::cutBatch(batch, {120, nodes}, {1, 1})) most = std::max(most, chunk.count);
    return most;
  };
  EXPECT_GT(longest(1000), 4U);
  EXPECT_EQ(longest(1U << 20U), 4U);  // 4 MiB of links a shot
  EXPECT_EQ(longest(1U << 26U), 1U);
}

TEST(BatchChunks, OfWorkersWithManyHandsHoldSomethingForEachAndAsManyLinksAsFit) {
  const auto scene = randomRoom(60, 2000, 1);
  const auto batch = mixedBatch(*scene, 1000);
  std::size_t next = 0;
  for (const auto& chunk : gpu::cutBatch(batch, {120, 1000}, {1, 16})) {
    if (chunk.kind != gpu::ShotKind::kScatter) continue;
    EXPECT_EQ(chunk.first, next);
    next += chunk.count;
    if (next < batch.scatter.size()) {
      EXPECT_GE(chunk.count, 64U);
    }
    EXPECT_LE(chunk.count, 400U);  // one is worked on while the links of another are taken in
  }
  EXPECT_EQ(next, batch.scatter.size());
  for (const auto& chunk : gpu::cutBatch(batch, {120, std::size_t{1} << 22U}, {1, 16})) {
    if (chunk.kind == gpu::ShotKind::kScatter && chunk.first + chunk.count < batch.scatter.size()) {
      EXPECT_EQ(chunk.count, 16U);  // 16 MiB of links a shot, 256 in all
    }
  }
}

TEST_F(Workers, AnyNumberOfWorkersGivesTheBitsOfOneProcess) {
  const auto scene = randomRoom(402, 13742, 2);
  auto batch = mixedBatch(*scene, 150);
  addLamps(batch);
  ASSERT_TRUE(in_process_->setScene(scene).has_value());
  const auto expected = run(*in_process_, *scene, batch);
  EXPECT_NE(expected.scattered, solver::Flux3{});
  EXPECT_NE(expected.gathered, solver::Flux3{});
  for (const int workers : {1, 2, 3}) {
    const auto transport = make(workers);
    ASSERT_TRUE(transport);
    ASSERT_TRUE(transport->setScene(scene).has_value());
    for (int i = 0; i < 2; ++i) expectSame(run(*transport, *scene, batch), expected);
  }
}

TEST_F(Workers, ANewSceneReplacesTheOld) {
  const auto transport = make(2);
  ASSERT_TRUE(transport);
  for (const std::uint32_t quads : {60U, 402U, 120U}) {
    const auto scene = randomRoom(quads, 5000, quads);
    const auto batch = mixedBatch(*scene, 30);
    ASSERT_TRUE(in_process_->setScene(scene).has_value());
    ASSERT_TRUE(transport->setScene(scene).has_value());
    expectSame(run(*transport, *scene, batch), run(*in_process_, *scene, batch));
  }
}

TEST_F(Workers, AnEmptyBatchDoesNothing) {
  const auto scene = randomRoom(60, 500, 1);
  const auto transport = make(2);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(transport->setScene(scene).has_value());
  expectSame(run(*transport, *scene, {}), accumulators(*scene));
}

TEST_F(Workers, KilledWorkersAreReplacedAndChangeNoBit) {
  const auto scene = randomRoom(402, 13742, 2);
  const auto batch = mixedBatch(*scene, 1200);
  ASSERT_TRUE(in_process_->setScene(scene).has_value());
  const auto expected = run(*in_process_, *scene, batch);
  const auto transport = make(2);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(transport->setScene(scene).has_value());
  for (int round = 0; round < 3; ++round) {
    const auto before = childWorkers();
    ASSERT_EQ(before.size(), 2U);
    std::thread killer([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(20 + 30 * round));
      kill(before[static_cast<std::size_t>(round % 2)], SIGKILL);
    });
    expectSame(run(*transport, *scene, batch), expected);
    killer.join();
    // killed in the run or just after it, the next run finds two living workers
    expectSame(run(*transport, *scene, batch), expected);
    const auto after = childWorkers();
    EXPECT_EQ(after.size(), 2U);
    EXPECT_EQ(std::count(after.begin(), after.end(), before[static_cast<std::size_t>(round % 2)]), 0);
  }
}

TEST_F(Workers, IdleWorkersThatWereKilledAreFoundReplacedAndChangeNoBit) {
  const auto scene = randomRoom(60, 2000, 1);
  const auto batch = mixedBatch(*scene, 40);
  ASSERT_TRUE(in_process_->setScene(scene).has_value());
  const auto expected = run(*in_process_, *scene, batch);
  const auto transport = make(2);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(transport->setScene(scene).has_value());
  expectSame(run(*transport, *scene, batch), expected);
  EXPECT_EQ(transport->look().missing, 0U);
  for (const auto worker : childWorkers()) kill(worker, SIGKILL);
  solver::Transport::Renderers found;
  for (int i = 0; i < 1000 && (found = transport->look()).missing < 2; ++i)
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  EXPECT_EQ(found.missing, 2U);
  EXPECT_EQ(found.wanted, 2U);
  EXPECT_NE(found.why.find("killed by signal 9"), std::string::npos) << found.why;
  ASSERT_TRUE(transport->replaceMissing().has_value());
  EXPECT_EQ(transport->look().missing, 0U);
  EXPECT_EQ(transport->look().why, "");
  EXPECT_EQ(transport->losses().count, 2U);
  EXPECT_EQ(childWorkers().size(), 2U);
  expectSame(run(*transport, *scene, batch), expected);
}

TEST_F(Workers, HungWorkersAreReplacedAndChangeNoBit) {
  const auto scene = randomRoom(402, 13742, 2);
  const auto batch = mixedBatch(*scene, 600);
  ASSERT_TRUE(in_process_->setScene(scene).has_value());
  const auto expected = run(*in_process_, *scene, batch);
  const auto transport = make(2, std::chrono::milliseconds(200));
  ASSERT_TRUE(transport);
  ASSERT_TRUE(transport->setScene(scene).has_value());
  expectSame(run(*transport, *scene, batch), expected);
  const auto before = childWorkers();
  ASSERT_EQ(before.size(), 2U);
  // Stopped before it gets its chunks, it answers none; stopped with chunks done, those must be done again.
  for (const int delay_ms : {0, 40}) {
    const auto living = childWorkers();
    ASSERT_FALSE(living.empty());
    if (delay_ms == 0) kill(living.front(), SIGSTOP);
    std::thread stopper([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(delay_ms));
      kill(living.front(), SIGSTOP);
    });
    expectSame(run(*transport, *scene, batch), expected);
    stopper.join();
    expectSame(run(*transport, *scene, batch), expected);  // or it hung just after the run
    const auto after = childWorkers();
    EXPECT_EQ(after.size(), 2U);
    EXPECT_EQ(std::count(after.begin(), after.end(), living.front()), 0) << "the stopped one is still there";
  }
}

TEST_F(Workers, ThatAreHardlyLetRunAreLateAndNotHung) {
  const auto scene = randomRoom(402, 13742, 2);
  const auto batch = mixedBatch(*scene, 60);
  ASSERT_TRUE(in_process_->setScene(scene).has_value());
  const auto expected = run(*in_process_, *scene, batch);
  const auto transport = make(2, std::chrono::milliseconds(200));  // and 2 us for each of 150,000 pixels
  ASSERT_TRUE(transport);
  ASSERT_TRUE(transport->setScene(scene).has_value());
  const auto workers = childWorkers();
  ASSERT_EQ(workers.size(), 2U);
  // As on a machine with much else to do: half a millisecond of processor time, then a tenth of a second of nothing.
  std::atomic<bool> over{false};
  std::thread brake([&] {
    while (!over) {
      for (const auto worker : workers) kill(worker, SIGSTOP);
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      const double before = processorSeconds(workers);
      for (const auto worker : workers) kill(worker, SIGCONT);
      for (int i = 0; i < 500 && processorSeconds(workers) < before + 5e-4; ++i)
        std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
    for (const auto worker : workers) kill(worker, SIGCONT);
  });
  expectSame(run(*transport, *scene, batch), expected);
  over = true;
  brake.join();
  EXPECT_EQ(transport->losses().count, 0U);
  EXPECT_EQ(childWorkers(), workers);
}

TEST_F(Workers, AnInterruptionEndsARunWithAHungWorkerAndEveryRunAfterIt) {
  const auto scene = randomRoom(60, 2000, 1);
  const auto batch = mixedBatch(*scene, 40);
  const auto transport = make(2, std::chrono::hours(1));
  ASSERT_TRUE(transport);
  ASSERT_TRUE(transport->setScene(scene).has_value());
  for (const auto worker : childWorkers()) kill(worker, SIGSTOP);
  auto flux = accumulators(*scene);
  std::thread interrupter([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    transport->interrupt();
  });
  EXPECT_FALSE(transport->run(batch, flux).has_value());  // within the test's time limit
  interrupter.join();
  expectSame(flux, accumulators(*scene));
  EXPECT_FALSE(transport->run(batch, flux).has_value());
  EXPECT_FALSE(transport->setScene(scene).has_value());
  EXPECT_TRUE(childWorkers().empty());
}

TEST_F(Workers, NoProcessIsLeftBehind) {
  {
    const auto transport = make(3);
    EXPECT_EQ(childWorkers().size(), 3U);
  }
  EXPECT_TRUE(childWorkers().empty());
}

TEST_F(Workers, AnExecutableThatIsNoWorkerIsAnErrorNotAHang) {
  const auto missing = gpu::makeWorkerTransport({1, "/nonexistent/program"});
  ASSERT_FALSE(missing.has_value());
  EXPECT_EQ(missing.error().code, ErrorCode::kUnavailable);
  const auto wrong = gpu::makeWorkerTransport({1, "/bin/false"});
  ASSERT_FALSE(wrong.has_value());
  EXPECT_EQ(wrong.error().code, ErrorCode::kUnavailable);
  EXPECT_NE(wrong.error().message.find("status 1"), std::string::npos) << wrong.error().message;
}

TEST_F(Workers, ABadShotIsRefusedAndTheWorkersLiveOn) {
  const auto scene = randomRoom(60, 500, 1);
  const auto transport = make(2);
  ASSERT_TRUE(transport);
  ASSERT_TRUE(transport->setScene(scene).has_value());
  const auto before = childWorkers();
  auto batch = mixedBatch(*scene, 4);
  batch.gather[0].point_count = 1000;
  auto flux = accumulators(*scene);
  EXPECT_FALSE(transport->run(batch, flux).has_value());
  EXPECT_EQ(childWorkers(), before);
}

}  // namespace
}  // namespace radiosity::test
