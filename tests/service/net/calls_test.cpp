// The methods without a socket: what a session is asked to do, and in which order.
#include "server/net/calls.h"
#include "server/net/convert.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <condition_variable>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "tests/service/fake_engine.h"

namespace radiosity::testing {
namespace {

using net::SharedText;
using ::testing::HasSubstr;
using ::testing::Not;

/// Keeps what it is told.
class FakePeer : public net::Peer {
 public:
  void sendText(SharedText text) override {
    if (on_text) on_text(*text);
    const std::lock_guard lock(mutex_);
    sent_.push_back(std::move(text));
  }
  void sendMissed(std::vector<SharedText> texts) override {
    const std::lock_guard lock(mutex_);
    sent_.insert(sent_.end(), texts.begin(), texts.end());
  }
  void sendProgress(SharedText /*text*/) override {}
  void lightmapsChanged() override {}
  void camerasChanged() override {}
  Timer later(std::chrono::milliseconds /*delay*/, std::function<void()> task) override {
    timers[++last_timer_] = std::move(task);
    return last_timer_;
  }
  void forget(Timer timer) override { timers.erase(timer); }
  void greeted() override {}
  void answered() override {}
  void tilesWanted() override {}
  void subscribed() override {}
  void closeAfterWrites(protocol::CloseCode /*code*/, std::string reason) override { closed_with = std::move(reason); }

  [[nodiscard]] std::vector<std::string> sent() const {
    const std::lock_guard lock(mutex_);
    std::vector<std::string> texts;
    for (const auto& text : sent_) texts.push_back(*text);
    return texts;
  }

  std::function<void(const std::string&)> on_text;
  std::map<Timer, std::function<void()>> timers;
  std::string closed_with;

 private:
  mutable std::mutex mutex_;
  std::vector<SharedText> sent_;
  Timer last_timer_ = 0;
};

class CallsTest : public ::testing::Test {
 protected:
  CallsTest() { hub->start(); }

  void hello(const std::string& more = "") {
    calls.handle(R"({"jsonrpc":"2.0","id":1,"method":"hello","params":{"client":"test")" + more + "}}");
  }
  void wait() { calls.handle(R"({"jsonrpc":"2.0","id":"w","method":"solve.wait","params":{"timeoutMs":86400000}})"); }
  void edit() {
    engine.patch({.patch = R"([{"op":"replace","path":"/asset/generator","value":"x"}])", .by = "other"},
                 [](const auto&) {});
  }

  FakeEngine engine;
  std::shared_ptr<net::Hub> hub = std::make_shared<net::Hub>(net::ServerOptions{}, engine);
  std::shared_ptr<FakePeer> peer = std::make_shared<FakePeer>();
  net::TileLane tiles;
  net::Calls calls{*hub, peer, tiles, true};
};

TEST_F(CallsTest, WhateverComesBeforeHelloIsTurnedAwayAsThat) {
  for (const auto* request : {R"({"jsonrpc":"2.0","id":1,"method":"no.such"})",
                              R"({"jsonrpc":"2.0","id":1,"method":"solve.wait","params":{"error":"x"}})",
                              R"({"jsonrpc":"2.0","id":1,"method":"status"})"}) {
    calls.handle(request);
    EXPECT_THAT(peer->sent().back(), HasSubstr(R"("code":-32001)")) << request;
    EXPECT_EQ(peer->closed_with, "the first request must be hello");
  }
  // A method's name may be anything, and a reason for closing must be UTF-8, which a cut name is not.
  calls.handle(R"({"jsonrpc":"2.0","id":1,"method":"hello","params":{"aé":1}})");
  EXPECT_EQ(peer->closed_with, "the first request was no hello");
}

TEST(FirstWarnings, AreCountedAsAnAnswerHasThem) {
  const std::vector<std::string> plain(100, std::string(2000, 'x')), control(100, std::string(2000, '\x01'));
  EXPECT_EQ(net::firstWarnings(plain).size(), 100U);
  EXPECT_LE(net::firstWarnings(control).size() * 12'000, protocol::kMaxMessageBytes / 4);
  EXPECT_GE(net::firstWarnings(control).size(), 10U);
}

TEST_F(CallsTest, TheHistoryOfASolveIsToldInNumbersThatJsonHas) {
  hello();
  engine.progress(std::numeric_limits<double>::infinity());
  calls.handle(R"({"jsonrpc":"2.0","id":"h","method":"solve.history"})");
  EXPECT_THAT(peer->sent().back(),
              HasSubstr(R"("samples":[{"residual":1.0,"sampling":0.0,"seconds":0.05,"texels":1.0,"total":1.0)"));
  EXPECT_THAT(peer->sent().back(), HasSubstr(R"("seconds":0.1,"texels":1000000000.0,"total":1000000000.0)"));
}

TEST_F(CallsTest, AWaitThatIsOverLeavesNoTimerBehind) {
  hello();
  engine.progress(0.01, engine::SolveState::kConverged);
  wait();
  EXPECT_THAT(peer->sent().back(), HasSubstr(R"("reached":true)"));
  EXPECT_TRUE(peer->timers.empty()) << "answered at once";

  engine.progress(0.5);
  wait();
  EXPECT_EQ(peer->timers.size(), 1U);
  engine.progress(0.01);
  EXPECT_THAT(peer->sent().back(), HasSubstr(R"("reached":true)"));
  EXPECT_TRUE(peer->timers.empty()) << "answered later";

  engine.progress(0.5);
  wait();
  const auto told = peer->sent().size();
  ASSERT_EQ(peer->timers.size(), 1U);
  std::exchange(peer->timers, {}).begin()->second();
  ASSERT_EQ(peer->sent().size(), told + 1);
  EXPECT_THAT(peer->sent().back(), HasSubstr(R"("reached":false)"));
  EXPECT_TRUE(peer->timers.empty()) << "given up";
}

TEST_F(CallsTest, WhereTexelsAreChosenAWaitIsForWhatIsMeasured) {
  hello();
  engine.configure(
      [](engine::SolveSettings settings) {
        settings.adaptive = true;
        return settings;
      },
      [](const auto&) {});
  const auto answers = [&] { return peer->sent().size(); };
  engine.surface(std::nullopt);
  engine.progress(0.01);
  const auto before = answers();
  calls.handle(R"({"jsonrpc":"2.0","id":"w","method":"solve.wait","params":{"error":0.05}})");
  engine.progress(0.01, engine::SolveState::kTimeLimit);
  EXPECT_EQ(answers(), before) << "it is being measured";
  engine.surface(0.03);
  engine.progress(0.03, engine::SolveState::kTimeLimit);
  EXPECT_THAT(peer->sent().back(), HasSubstr(R"("reached":true)"));
  EXPECT_THAT(peer->sent().back(), HasSubstr(R"("p95":0.09)"));
  engine.surface(0.07);
  engine.progress(0.07, engine::SolveState::kTimeLimit);
  calls.handle(R"({"jsonrpc":"2.0","id":"x","method":"solve.wait","params":{"error":0.05}})");
  EXPECT_THAT(peer->sent().back(), HasSubstr(R"("reached":false)"));
}

TEST(Merged, AsManyTexelsAsUsualAreAsManyAsAreUsualAfterwards) {
  engine::SolveSettings chosen;
  chosen.adaptive = true;
  chosen.texels = kMostTexels;
  const auto after = [&](protocol::SolveConfigureCall call) { return net::merged(chosen, call).texels; };
  EXPECT_EQ(after({.adaptive = false}), kTexels);
  EXPECT_EQ(after({.method = Method::kPaper}), kTexels);
  EXPECT_EQ(after({.target_error = 0.1}), kMostTexels);
  EXPECT_EQ(after({.texels = 500, .adaptive = false}), 500U);
  chosen.texels = 700;
  EXPECT_EQ(after({.adaptive = false}), 700U);
}

// The answer to hello is followed by another client's edit as closely as can be: from another thread, which is given
// time to get through.
TEST_F(CallsTest, AnEditThatComesBetweenTheAnswerToHelloAndTheFirstBroadcastReachesTheClientOnceAndInOrder) {
  edit();
  std::thread editor;
  peer->on_text = [&](const std::string& text) {
    if (text.find("creditBytes") == std::string::npos || editor.joinable()) return;
    auto through = std::make_shared<std::pair<std::mutex, std::condition_variable>>();
    std::unique_lock lock(through->first);
    editor = std::thread([this, through] {
      edit();
      through->second.notify_all();
    });
    (void)through->second.wait_for(lock, std::chrono::milliseconds(300));
  };
  hello(R"(,"resume":{"epoch":")" + hub->epoch() + R"(","revision":0,"tileVersion":0})");
  editor.join();
  std::vector<std::string> patched;
  for (const auto& text : peer->sent())
    if (text.find("scene.patched") != std::string::npos) patched.push_back(text);
  ASSERT_EQ(patched.size(), 2U);
  EXPECT_THAT(patched[0], HasSubstr(R"("revision":1)"));
  EXPECT_THAT(patched[1], HasSubstr(R"("revision":2)"));
  EXPECT_THAT(peer->sent().front(), HasSubstr(R"("resumed":true)"));
}

}  // namespace
}  // namespace radiosity::testing
