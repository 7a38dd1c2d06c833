// Pictures and files: whose turn it is, and what ends when nobody waits for it.
#include "server/engine/loop/long_work.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <functional>
#include <mutex>
#include <new>
#include <string>
#include <thread>

namespace radiosity::engine {
namespace {

TEST(FairQueue, SessionsComeInTurnEachWithItsOwnInOrder) {
  FairQueue<int> queue;
  for (const auto& [session, item] : {std::pair(1, 10), {1, 11}, {1, 12}, {2, 20}, {3, 30}, {2, 21}})
    queue.push(static_cast<std::uint64_t>(session), item);
  EXPECT_EQ(queue.size(), 6U);
  std::vector<int> order;
  while (const auto item = queue.pop()) order.push_back(*item);
  EXPECT_EQ(order, (std::vector<int>{10, 20, 30, 11, 21, 12}));
  EXPECT_EQ(queue.size(), 0U);
}

TEST(FairQueue, ASessionThatComesLaterWaitsForOneItemOfEachOther) {
  FairQueue<int> queue;
  for (int i = 0; i < 100; ++i) queue.push(1, i);
  (void)queue.pop();
  queue.push(2, 1000);
  EXPECT_EQ(queue.pop(), 1);
  EXPECT_EQ(queue.pop(), 1000);
  EXPECT_EQ(queue.pop(), 2);
}

TEST(FairQueue, GivesUpWhatMatches) {
  FairQueue<int> queue;
  for (int i = 0; i < 6; ++i) queue.push(static_cast<std::uint64_t>(i % 2), i);
  EXPECT_EQ(queue.takeIf([](int item) { return item % 2 == 1 || item == 4; }), (std::vector<int>{4, 1, 3, 5}));
  EXPECT_EQ(queue.size(), 2U);
  EXPECT_EQ(queue.pop(), 0);
  EXPECT_EQ(queue.pop(), 2);
  EXPECT_FALSE(queue.pop());
}

class LongWorkTest : public testing::Test {
 protected:
  ~LongWorkTest() override { go_ = true; }

  /// Holds the thread until go(), or until it is called off.
  void hold(const Client& client = {}) {
    ASSERT_TRUE(work_.push(
        client,
        [this] {
          holding_ = true;
          while (!go_) {
            interruptionPoint();
            std::this_thread::sleep_for(std::chrono::milliseconds(1));
          }
          note("held");
        },
        [this](const Error& error) { note("held: " + std::to_string(static_cast<int>(error.code))); }));
    while (!holding_) std::this_thread::yield();
  }
  [[nodiscard]] bool push(const Client& client, const std::string& name) {
    return work_.push(
        client, [this, name] { note(name); }, [this, name](const Error&) { note(name + " refused"); });
  }
  void note(const std::string& text) {
    const std::scoped_lock lock(mutex_);
    notes_.push_back(text);
  }
  /// Once there are so many.
  std::vector<std::string> notes(std::size_t count) {
    while (true) {
      {
        const std::scoped_lock lock(mutex_);
        if (notes_.size() >= count) return notes_;
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
  }
  static Client session(std::uint64_t number, std::stop_token gone = {}) { return {"", number, std::move(gone)}; }

  std::atomic<bool> go_{false}, holding_{false};
  std::mutex mutex_;
  std::vector<std::string> notes_;
  LongWork work_{8, [] {}};
};

const std::string kHeldCancelled = "held: " + std::to_string(static_cast<int>(ErrorCode::kCancelled));

TEST_F(LongWorkTest, ServesSessionsInTurn) {
  hold();
  for (const auto* name : {"a1", "a2", "a3"}) ASSERT_TRUE(push(session(1), name));
  for (const auto* name : {"b1", "b2"}) ASSERT_TRUE(push(session(2), name));
  go_ = true;
  EXPECT_EQ(notes(6), (std::vector<std::string>{"held", "a1", "b1", "a2", "b2", "a3"}));
}

TEST_F(LongWorkTest, EndsWhatIsUnderWayForSomebodyWhoHasGone) {
  std::stop_source gone;
  hold(session(1, gone.get_token()));
  ASSERT_TRUE(push(session(1, gone.get_token()), "a"));
  ASSERT_TRUE(push(session(2), "b"));
  gone.request_stop();
  EXPECT_EQ(notes(3), (std::vector<std::string>{kHeldCancelled, "a refused", "b"}));
}

TEST_F(LongWorkTest, WhatWaitsForThoseWhoHaveGoneKeepsNobodyOut) {
  hold();
  std::stop_source gone;
  for (int i = 0; i < 8; ++i) ASSERT_TRUE(push(session(1, gone.get_token()), "a"));
  EXPECT_FALSE(push(session(2), "b")) << "so many may wait";
  gone.request_stop();
  EXPECT_TRUE(push(session(2), "b"));
  EXPECT_EQ(notes(8).size(), 8U) << "those are told, be they there or not";
}

TEST_F(LongWorkTest, CalledOffRefusesAllAndWhatComesLater) {
  hold();
  ASSERT_TRUE(push(session(1), "a"));
  work_.callOff();
  EXPECT_THAT(notes(2), testing::UnorderedElementsAre("a refused", kHeldCancelled));
  ASSERT_TRUE(push(session(1), "late"));
  EXPECT_EQ(notes(3).back(), "late refused");
}

TEST_F(LongWorkTest, RunningOutOfMemoryEndsOnePieceOfWork) {
  ASSERT_TRUE(work_.push(
      {}, [] { throw std::bad_alloc(); }, [this](const Error& error) { note(error.message.substr(0, 19)); }));
  ASSERT_TRUE(push({}, "next"));
  EXPECT_EQ(notes(2), (std::vector<std::string>{"the server's memory", "next"}));
}

}  // namespace
}  // namespace radiosity::engine
