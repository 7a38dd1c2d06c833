#include "server/engine/lit/disposer.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>

namespace radiosity::engine {
namespace {

struct Witness {
  std::function<void()> when_gone;
  ~Witness() { when_gone(); }
};

TEST(Disposer, destroysOnAThreadOfItsOwnAndAllOfItBeforeItsEnd) {
  std::atomic<int> gone{0}, gone_here{0};
  const auto here = std::this_thread::get_id();
  const auto count = [&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    ++gone;
    if (std::this_thread::get_id() == here) ++gone_here;
  };
  {
    Disposer disposer;
    for (int i = 0; i < 20; ++i) {
      disposer.dispose(std::make_unique<Witness>(count));
      disposer.dispose(std::shared_ptr<const void>(std::make_shared<Witness>(count)));
    }
    disposer.dispose(std::shared_ptr<const void>());
    disposer.dispose(std::unique_ptr<Witness>());
  }
  EXPECT_EQ(gone, 40);
  EXPECT_EQ(gone_here, 0);
}

TEST(Disposer, isWaitedForWhereMemoryIsNeeded) {
  std::atomic<int> gone{0};
  Disposer disposer;
  EXPECT_FALSE(disposer.drain());
  disposer.dispose(std::make_unique<Witness>([&] {
    std::this_thread::sleep_for(std::chrono::milliseconds(20));
    ++gone;
  }));
  EXPECT_TRUE(disposer.drain());
  EXPECT_EQ(gone, 1);
}

TEST(Disposer, leavesWhatOthersHoldToThem) {
  bool gone = false;
  const auto held = std::make_shared<Witness>([&] { gone = true; });
  { Disposer().dispose(std::shared_ptr<const void>(held)); }
  EXPECT_FALSE(gone);
}

}  // namespace
}  // namespace radiosity::engine
