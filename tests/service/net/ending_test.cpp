// How connections end that nobody closes: the server drains, or the peer is gone without a word.
#include <gtest/gtest.h>

#include <chrono>
#include <latch>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "tests/service/net/replies.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using namespace protocol;  // NOLINT: the test speaks the protocol
using std::chrono::milliseconds;

TEST(Drain, TellsClientsFinishesAndCloses) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  server.engine.progress(0.5);
  socket.sendText(encodeCall("7", SolveWaitCall{}));
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), 0);
  RawHttp idle(server.port());
  idle.send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");
  EXPECT_EQ(idle.receive().status, 200);
  server.drain();
  const auto refused = awaitAnswer(socket, "7");
  EXPECT_EQ(codeOf(refused), -32053) << "who waits is told";
  EXPECT_EQ(closeCodeOf(socket), 1001);
  EXPECT_TRUE(idle.closed(Seconds(10)));
  server.stop();
}

TEST(Drain, IsAnnounced) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  server.drain();
  EXPECT_TRUE(socket.waitFor("draining").has_value());
  EXPECT_EQ(closeCodeOf(socket), 1001);
}

/// An edit, as call 7, that the engine has and does not answer yet.
void askForWhatWaits(RunningServer& server, TestSocket& socket) {
  server.engine.holdAnswers();
  socket.sendText(encodeCall("7", somePatch()));
  while (server.engine.patchesSeen() == 0) std::this_thread::sleep_for(milliseconds(1));
}

TEST(Drain, WhatWasAskedBeforeIsAnsweredFirst) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  askForWhatWaits(server, socket);
  server.drain();
  EXPECT_TRUE(socket.waitFor("draining").has_value());
  EXPECT_EQ(codeOf(socket.call(StatusCall{})), -32053) << "what comes later is not";
  server.engine.release();
  EXPECT_EQ(replyOf<ScenePatchReply>(awaitAnswer(socket, "7")).revision, 1U);
  EXPECT_EQ(closeCodeOf(socket), 1001);
}

TEST(Drain, AnAnswerThatDoesNotComeIsNotWaitedFor) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  askForWhatWaits(server, socket);
  server.drain();
  EXPECT_EQ(closeCodeOf(socket), 1001);
  server.stop();
}

// A connection is told of the drain by another thread while it becomes a session. What it uses then is seen by a thread
// sanitizer, and now and then by the processor.
TEST(Drain, InTheMiddleOfUpgradesHarmsNobody) {
  net::ServerOptions options;
  options.port = 0;
  options.drain_grace = std::chrono::minutes(10);  // who is not told would keep it waiting
  for (int round = 0; round < 20; ++round) {
    FakeEngine engine;
    auto opened = net::Server::open(options, engine);
    ASSERT_TRUE(opened.has_value());
    auto server = std::move(*opened);
    std::latch drained(1);
    std::thread running([&] {
      server->run();
      drained.wait();
      server.reset();  // as its owner does: with it goes a connection that was accepted while the last one ended
    });
    std::vector<std::unique_ptr<RawHttp>> upgrading;
    for (int i = 0; i < 40; ++i) upgrading.push_back(std::make_unique<RawHttp>(server->port()));
    std::thread drainer([&] { server->drain(); });
    for (auto& connection : upgrading)
      connection->send(
          "GET /ws HTTP/1.1\r\nHost: localhost\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Version: "
          "13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\nSec-WebSocket-Protocol: radiosity.v1\r\n\r\n");
    drainer.join();
    drained.count_down();
    for (auto& connection : upgrading) EXPECT_TRUE(connection->closed(Seconds(20))) << "it was not told";
    upgrading.clear();
    running.join();
  }
}

TEST(Drain, CallsOffWhatTheEngineIsAt) {
  RunningServer server;
  EXPECT_FALSE(server.engine.calledOff());
  server.stop();
  EXPECT_TRUE(server.engine.calledOff());
}

/// The client of the newest load, picture or file that the engine was asked for; it does not answer.
engine::Client clientOf(RunningServer& server, std::size_t asked) {
  while (server.engine.clients().size() < asked) std::this_thread::sleep_for(milliseconds(1));
  return server.engine.clients().back();
}

void expectGone(const engine::Client& client) {
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  while (!client.gone.stop_requested() && std::chrono::steady_clock::now() < deadline)
    std::this_thread::sleep_for(milliseconds(1));
  EXPECT_TRUE(client.gone.stop_requested());
}

TEST(Leaving, OfAWebSocketReachesWhatTheEngineIsAtForIt) {
  RunningServer server;
  server.engine.holdAnswers();
  TestSocket stays(server.port());
  stays.hello();
  stays.sendText(encodeCall("7", SnapshotCall{}));
  const auto other = clientOf(server, 1);
  {
    TestSocket leaves(server.port());
    leaves.hello();
    leaves.sendText(encodeCall("7", SnapshotCall{}));
    const auto client = clientOf(server, 2);
    EXPECT_NE(client.session, 0U);
    EXPECT_NE(client.session, other.session);
    EXPECT_FALSE(client.gone.stop_requested());
    leaves.close();
    expectGone(client);
  }
  EXPECT_FALSE(other.gone.stop_requested());
  server.engine.release();
}

TEST(Leaving, OfAnHttpClientReachesWhatTheEngineIsAtForIt) {
  RunningServer server;
  server.engine.holdAnswers();
  std::size_t asked = 0;
  for (const auto* target : {"/scene.glb", "/scene-unlit.glb", "/lightmaps/0.exr", "/snapshot.png"}) {
    auto leaves = std::make_unique<RawHttp>(server.port());
    leaves->send(std::string("GET ") + target + " HTTP/1.1\r\nHost: localhost\r\n\r\n");
    const auto client = clientOf(server, ++asked);
    EXPECT_NE(client.session, 0U);
    std::this_thread::sleep_for(milliseconds(150));
    EXPECT_FALSE(client.gone.stop_requested()) << "it waits";
    leaves.reset();
    expectGone(client);
  }
  auto loads = std::make_unique<RawHttp>(server.port());
  loads->send("PUT /scene HTTP/1.1\r\nHost: localhost\r\nContent-Length: 4\r\n\r\nroom");
  const auto client = clientOf(server, ++asked);
  loads->send("GET /healthz HTTP/1.1\r\nHost: localhost\r\n\r\n");  // bytes that are not read yet hide nothing
  loads.reset();
  expectGone(client);
  server.engine.release();
}

TEST(Leaving, IsNotWhatAnAnswerIsFollowedBy) {
  RunningServer server;
  RawHttp connection(server.port());
  for (std::size_t asked = 1; asked < 4; ++asked) {
    connection.send("GET /snapshot.png HTTP/1.1\r\nHost: localhost\r\n\r\n");
    EXPECT_EQ(connection.receive().status, 200);
    EXPECT_FALSE(clientOf(server, asked).gone.stop_requested());
  }
}

TEST(Liveness, APeerThatDoesNotAnswerPingsIsGone) {
  net::ServerOptions options;
  options.idle_timeout = milliseconds(200);
  RunningServer server(options);
  TestSocket silent(server.port());
  silent.hello();  // answers pings only while it reads, and from here on it does not
  TestSocket lively(server.port());
  lively.hello();
  auto viewers = lively.waitFor("viewers");  // 1: on a slow machine the silent one was gone by then
  if (viewers->params->at("count") == 2) viewers = lively.waitFor("viewers");
  EXPECT_EQ(viewers->params->at("count"), 1);
}

}  // namespace
}  // namespace radiosity::testing
