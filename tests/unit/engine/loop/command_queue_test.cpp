#include "server/engine/loop/command_queue.h"

#include <gtest/gtest.h>

#include <memory>
#include <thread>

namespace radiosity::engine {
namespace {

TEST(CommandQueue, CommandsComeOutInTheOrderTheyWentIn) {
  CommandQueue queue(8);
  std::vector<int> done;
  for (int i = 0; i < 3; ++i) ASSERT_TRUE(queue.push([&done, i] { done.push_back(i); }));
  const auto due = queue.take(true);
  ASSERT_TRUE(due);
  for (const auto& command : *due) command();
  EXPECT_EQ(done, (std::vector<int>{0, 1, 2}));
  EXPECT_TRUE(queue.take(false)->empty());
}

TEST(CommandQueue, WhoWaitsMayWantToLookUpNowAndThen) {
  CommandQueue queue(8);
  const auto none = queue.take(true, std::chrono::milliseconds(1));
  ASSERT_TRUE(none) << "it is not closed";
  EXPECT_TRUE(none->empty());
  ASSERT_TRUE(queue.push([] {}));
  EXPECT_EQ(queue.take(true, std::chrono::hours(1))->size(), 1U);
}

TEST(CommandQueue, LongCommandsWaitForAllElseAndComeOutOneByOne) {
  CommandQueue queue(8);
  std::vector<int> done;
  const auto note = [&done](int i) { return [&done, i] { done.push_back(i); }; };
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(queue.push(note(10 + i), CommandQueue::Kind::kLong));
  const auto runSome = [&] {
    const auto due = queue.take(true);
    ASSERT_TRUE(due);
    for (const auto& command : *due) command();
  };
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(queue.push(note(i)));
  runSome();
  EXPECT_EQ(done, (std::vector<int>{0, 1}));
  runSome();
  ASSERT_TRUE(queue.push(note(2)));
  runSome();
  runSome();
  EXPECT_EQ(done, (std::vector<int>{0, 1, 10, 2, 11}));
}

// Whoever asks over and over does not keep others from what takes longer, nor these each other's turns from it.
TEST(CommandQueue, LongCommandsThatHaveWaitedLongEnoughTakeTurnsWithAllElse) {
  CommandQueue queue(8, std::chrono::nanoseconds(0));
  std::vector<int> done;
  const auto note = [&done](int i) { return [&done, i] { done.push_back(i); }; };
  for (int i = 0; i < 2; ++i) ASSERT_TRUE(queue.push(note(10 + i), CommandQueue::Kind::kLong));
  for (int i = 0; i < 5; ++i) {
    ASSERT_TRUE(queue.push(note(i)));
    const auto due = queue.take(true);
    ASSERT_TRUE(due);
    for (const auto& command : *due) command();
  }
  EXPECT_EQ(done, (std::vector<int>{0, 10, 1, 2, 11, 3, 4}));
}

TEST(CommandQueue, FullQueueRefusesUntilItIsEmptied) {
  CommandQueue queue(2);
  EXPECT_TRUE(queue.push([] {}));
  EXPECT_TRUE(queue.push([] {}));
  EXPECT_FALSE(queue.push([] {}));
  EXPECT_EQ(queue.take(false)->size(), 2U);
  EXPECT_TRUE(queue.push([] {}));
}

TEST(CommandQueue, AWakeUpEndsASleepAndPressesNobody) {
  CommandQueue queue(2);
  std::optional<std::vector<CommandQueue::Command>> due;
  std::thread sleeper([&] { due = queue.take(true); });
  queue.wake();
  sleeper.join();
  ASSERT_TRUE(due);
  EXPECT_TRUE(due->empty());
  EXPECT_TRUE(queue.wasWoken());
  queue.wake();
  EXPECT_FALSE(queue.isPressing());
  ASSERT_TRUE(queue.push([] {}));
  EXPECT_TRUE(queue.isPressing());
  EXPECT_EQ(queue.take(false)->size(), 1U);
  EXPECT_TRUE(queue.wasWoken());
  EXPECT_TRUE(queue.take(false)->empty());
  EXPECT_FALSE(queue.wasWoken());
}

TEST(CommandQueue, ClosingWakesTheSleeperAndRefusesFromThenOn) {
  CommandQueue queue(2);
  bool ended = false;
  std::thread sleeper([&] { ended = !queue.take(true).has_value(); });
  queue.close();
  sleeper.join();
  EXPECT_TRUE(ended);
  EXPECT_FALSE(queue.push([] {}));
}

}  // namespace
}  // namespace radiosity::engine
