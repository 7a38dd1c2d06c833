#include "common/parallel.h"

#include <gtest/gtest.h>

#include <array>
#include <atomic>
#include <chrono>
#include <new>
#include <stdexcept>
#include <thread>
#include <vector>

namespace radiosity {
namespace {

TEST(Shares, AreDoneOnceEach) {
  for (const std::size_t shares : {0U, 1U, 2U, 3U, 16U, 100U}) {
    std::vector<std::atomic<int>> times(shares);
    const auto work = [&](std::size_t share) { ++times.at(share); };
    doShares(shares, ShareOfWork(work));
    for (const auto& time : times) EXPECT_EQ(time, 1);
  }
}

TEST(Shares, TheFirstIsOfTheThreadThatAsks) {
  for (int i = 0; i < 1000; ++i) {
    const auto asks = std::this_thread::get_id();
    auto does = std::thread::id();
    const auto work = [&](std::size_t share) {
      if (share == 0) does = std::this_thread::get_id();
    };
    doShares(3, ShareOfWork(work));
    EXPECT_EQ(does, asks);
  }
}

TEST(Shares, AreDoneSideBySideWhereThereAreCores) {
  if (mostShares() == 1) GTEST_SKIP() << "one core";
  std::atomic<int> here{0};
  const auto meet = [&](std::size_t) {
    ++here;
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    while (here < 2 && std::chrono::steady_clock::now() < end) std::this_thread::yield();
    EXPECT_EQ(here, 2);
  };
  doShares(2, ShareOfWork(meet));
}

// A helper that waited for a share of its own share while nobody was left to do it would wait for ever.
TEST(Shares, MayBeDividedAgainAndAskedForByMany) {
  std::atomic<int> done{0};
  const auto askMuch = [&] {
    for (int i = 0; i < 100; ++i) {
      inShares(mostShares(), [&](std::size_t, std::size_t) {
        inTurns(5, [&](std::size_t) { inShares(3, [&](std::size_t, std::size_t) { ++done; }); });
      });
    }
  };
  std::vector<std::thread> askers;
  for (int i = 0; i < 4; ++i) askers.emplace_back(askMuch);
  for (auto& asker : askers) asker.join();
  const int shares = static_cast<int>(mostShares());
  EXPECT_EQ(done, 4 * 100 * shares * 5 * std::min(3, shares));
}

TEST(Shares, HandOnWhatOneOfThemThrowsWhenAllHaveEnded) {
  for (const std::size_t failing : {0U, 1U, 2U}) {
    std::array<std::atomic<bool>, 3> ended{};
    const auto work = [&](std::size_t share) {
      if (share == failing) throw std::bad_alloc();
      std::this_thread::sleep_for(std::chrono::milliseconds(5));
      ended.at(share) = true;
    };
    EXPECT_THROW(doShares(3, ShareOfWork(work)), std::bad_alloc);
    for (std::size_t share = 0; share < 3; ++share) EXPECT_EQ(ended.at(share), share != failing);
  }
  int after = 0;
  inTurns(
      3, [&](std::size_t) { ++after; }, 1);
  EXPECT_EQ(after, 3) << "in one thread";
}

TEST(Turns, AreTakenOnceEachHoweverManyThreadsThereAre) {
  for (const std::size_t most : {0UL, 1UL, 2UL, SIZE_MAX}) {
    std::vector<std::atomic<int>> times(1000);
    inTurns(
        times.size(), [&](std::size_t part) { ++times.at(part); }, most);
    for (const auto& time : times) EXPECT_EQ(time, 1);
  }
}

}  // namespace
}  // namespace radiosity
