// Timers of a session that is cut while their handlers wait their turn.
#include "server/net/session_timers.h"

#include <gtest/gtest.h>

#include <boost/asio/io_context.hpp>
#include <memory>
#include <thread>
#include <vector>

namespace radiosity::testing {
namespace {

using net::SessionTimers;
using std::chrono::milliseconds;

struct SessionTimersTest : ::testing::Test {
  boost::asio::io_context context;
  std::shared_ptr<SessionTimers> timers = std::make_shared<SessionTimers>(context.get_executor());
  std::vector<int> ran;

  /// The handlers of all timers whose time is up become due together.
  void runWhenAllAreUp() {
    std::this_thread::sleep_for(milliseconds(5));
    context.run();
  }
};

TEST_F(SessionTimersTest, RunEachTaskOnce) {
  for (int i = 0; i < 3; ++i) (void)timers->start(timers, milliseconds(i), [this, i] { ran.push_back(i); });
  context.run();
  EXPECT_EQ(ran, (std::vector<int>{0, 1, 2}));
}

TEST_F(SessionTimersTest, ThoseThatAreCancelledAfterTheirTimeWasUpDoNotRun) {
  for (int i = 0; i < 5; ++i)
    (void)timers->start(timers, milliseconds(1), [this, i] {
      ran.push_back(i);
      timers->cancelAll();
    });
  runWhenAllAreUp();
  EXPECT_EQ(ran.size(), 1U);
}

TEST_F(SessionTimersTest, OneCanBeCancelledAtAnyTime) {
  SessionTimers::Number second = 0;
  (void)timers->start(timers, milliseconds(1), [&] {
    ran.push_back(1);
    timers->cancel(second);
  });
  second = timers->start(timers, milliseconds(1), [this] { ran.push_back(2); });
  const auto early = timers->start(timers, milliseconds(1), [this] { ran.push_back(3); });
  timers->cancel(early);
  timers->cancel(early);
  runWhenAllAreUp();
  EXPECT_EQ(ran, std::vector<int>{1});
}

TEST_F(SessionTimersTest, NothingRunsOnceTheOwnerIsGone) {
  (void)timers->start(timers, milliseconds(1), [this] { ran.push_back(1); });
  timers.reset();
  context.run();
  EXPECT_TRUE(ran.empty());
}

}  // namespace
}  // namespace radiosity::testing
